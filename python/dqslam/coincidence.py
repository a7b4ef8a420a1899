"""Objects that their own boxes contradict.

Ids that are switched give an object the boxes of another one. If most of its boxes are such, it is
mapped where the other one is, fits these boxes, and looks certain. Two objects may also get most of
each other's boxes, and be mapped in each other's places.
"""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints

# An object is contradicted where more than this share of its boxes does not fit.
MOST_MISFITS = 0.5
# Two objects are at one place where this share of the boxes that fit the one would fit the other.
SAME_PLACE_SHARE = 0.5
# The ids of two objects may be exchanged where the boxes of the one that show the other are at
# least this share of those that fit it, and at least so many.
EXCHANGED_SHARE = 0.4
FEWEST_EXCHANGED = 3


def contradicted_objects(
    core: _core.Graph, state: _core.State, inliers: Bools, object_ids: Ints
) -> dict[int, str]:
    """Return the objects that their boxes contradict, with the reason, by id.

    Of two objects at one place, it is the one that fewer boxes fit. Where many of the boxes of an
    object show another one instead, each may be in the other's place: no data tell.

    Parameters
    ----------
    core, state
        A problem, and its estimate with ellipsoids, NaN for an object that takes no part.
    inliers
        Whether each box fits its object, shape (b,).
    object_ids
        Shape (o,).
    """
    landmarks, object_of_box = state.landmarks, core.boxes.object
    reach = _longest_semi_axes(landmarks)
    real = np.isfinite(reach)
    count = np.bincount(object_of_box, minlength=len(object_ids))
    fit = np.bincount(object_of_box[inliers], minlength=len(object_ids))
    reasons = {}
    for row in np.flatnonzero(real & (count > 0)).tolist():
        misfits = count[row] - fit[row]
        if misfits > MOST_MISFITS * count[row]:
            reasons[int(object_ids[row])] = f"{misfits} of {count[row]} boxes do not fit"
            continue
        if misfits >= max(FEWEST_EXCHANGED, EXCHANGED_SHARE * fit[row]):
            shown, other = _shown_instead(core, state, np.flatnonzero(real), inliers, row)
            if shown >= max(FEWEST_EXCHANGED, EXCHANGED_SHARE * fit[row]):
                reasons[int(object_ids[row])] = (
                    f"{shown} of its boxes show object {object_ids[other]}, and {fit[row]} fit its "
                    "place: their ids may be exchanged"
                )
                continue
        rivals = real & _near(state.landmarks, reach, row) & (fit >= fit[row])
        for other in np.flatnonzero(rivals).tolist():
            if other == row or (fit[other] == fit[row] and other > row):
                continue
            boxes = np.flatnonzero(inliers & (object_of_box == row))
            if np.mean(_fits(core, state, boxes, other)) >= SAME_PLACE_SHARE:
                reasons[int(object_ids[row])] = (
                    f"it is where object {object_ids[other]} is, which fits its boxes as well"
                )
                break
    return reasons


def _shown_instead(
    core: _core.Graph, state: _core.State, objects: Ints, inliers: Bools, row: int
) -> tuple[int, int]:
    """Return how many of an object's other boxes fit the object that most of them fit; its row."""
    boxes = np.flatnonzero(~inliers & (core.boxes.object == row))
    others = objects[objects != row].tolist()
    counts = [int(_fits(core, state, boxes, other).sum()) for other in others]
    return max(zip(counts, others, strict=True), default=(0, row))


def _longest_semi_axes(ellipsoids: Floats) -> Floats:
    """Return the longest semi-axis of each ellipsoid, shape (o,), NaN where there is none."""
    longest = np.full(len(ellipsoids), np.nan)
    for row in np.flatnonzero(np.isfinite(ellipsoids).all(axis=1)).tolist():
        longest[row] = _core.axes_from_ellipsoid(ellipsoids[row])[1].max()
    return longest


def _near(ellipsoids: Floats, reach: Floats, row: int) -> Bools:
    """Return which objects are nearer to one than the reach of either, shape (o,)."""
    distance = np.linalg.norm(ellipsoids[:, :3] - ellipsoids[row, :3], axis=1)
    return np.asarray(distance < np.fmax(reach, reach[row]))


def _fits(core: _core.Graph, state: _core.State, boxes: Ints, row: int) -> Bools:
    """Return whether boxes, given by rows (b,), would fit an object."""
    table = core.boxes
    chi2 = _core.box_chi_squares(
        core.pose_model,
        core.camera,
        state.poses[table.pose[boxes]],
        np.tile(state.landmarks[row], (len(boxes), 1)),
        table.box[boxes],
        table.covariance[boxes],
        table.truncated[boxes],
    )
    return np.asarray(chi2 <= _core.SolveOptions().outlier_chi_square)
