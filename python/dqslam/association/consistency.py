"""Objects that are one, that moved, that are no objects: found by comparing their boxes."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from dqslam._checks import Floats
from dqslam._ids import ObjectRow
from dqslam.association.scene_map import SceneMap
from dqslam.assumptions.traffic import usual_size

# Two objects are one if the chi-square of their distance is below this: 99 %, 3 dof.
DUPLICATE_MAX_CHI2 = 11.34
# Fitted centers of one box-shaped object, seen from two sides, differ by this part of its size.
DUPLICATE_CENTER_SIGMA = 0.3
# Only centers nearer than so many times the sum of their sizes are compared: it costs a covariance.
DUPLICATE_MAX_SIZES_APART = 4.0
# Of two classes, only what is in one place and as large is one: nearer than this part of the
# smaller size, and larger by this factor at most.
RENAMED_MAX_SIZES_APART = 0.5
RENAMED_MAX_SIZE_FACTOR = 1.5
# Two boxes on one thing are a detector's mistake in at most this share of the rarer one's images.
DUPLICATE_MAX_SEEN_TOGETHER = 0.1

# A class has a usual size once it has so many objects: of fewer, half may be wrong.
MISFIT_MIN_OBJECTS = 5
# Logarithms of sizes within a class spread by at least this; a few that agree show less by chance.
MISFIT_MIN_SPREAD = 0.15
# An object further off the usual log size, in spreads, is left out.
MISFIT_MAX_SPREADS = 3.0
# Of traffic the usual log size is learned from objects that are off the known one by less: what
# moves towards us looks half as large, which is off by 0.69.
MISFIT_MAX_OFF_KNOWN = 0.5

# An object moved when no place explains its boxes from a path that is not bent to them: median
# chi-square above 99 % of chance, 4 dof ...
MOVER_MIN_CHI2 = 13.28
# ... and the path is bent to them: that costs so many chi-squares a box, and so many times as much
# as boxes usually have.
MOVER_MIN_COST_PER_BOX = 2.0
MOVER_MIN_COST_RATIO = 2.0
# A median of fewer boxes is chance.
MOVER_MIN_BOXES = 8
# The path hardly changes any more after so many iterations without an object.
MOVER_MAX_ITERATIONS = 8
# Median of chi-square with 4 degrees of freedom: how well the boxes of an object at rest fit.
MEDIAN_CHI2 = 3.36

# An id names one thing if one place explains at least half of its boxes.
SCATTERED_MAX_SHARE = 0.5


def join_duplicates(scene: SceneMap) -> None:
    """Join objects that may be in one place and are never seen together."""
    labels = scene.labels
    pairs = close_pairs(scene)
    if not pairs:
        return
    involved, covariance = scene.joint_covariance(len(scene.poses) - 1, np.unique(pairs))
    k = len(covariance) - 9 * len(involved)
    place = {row: k + 9 * number for number, row in enumerate(involved.tolist())}
    size = np.exp(scene.log_sizes())
    for kept, given_up in pairs:
        if kept not in place or given_up not in place:
            continue
        if labels.box_counts[kept] == 0 or labels.box_counts[given_up] == 0:
            continue
        if labels.look_different(kept, given_up):
            continue
        if _are_seen_together(scene, kept, given_up):  # since one of them was joined with a third
            continue
        spread = _covariance_of_difference(covariance, place[kept], place[given_up])
        sigma = DUPLICATE_CENTER_SIGMA * min(size[kept], size[given_up])
        spread = spread + sigma**2 * np.eye(3)
        apart = scene.ellipsoids[kept, :3] - scene.ellipsoids[given_up, :3]
        if apart @ np.linalg.solve(spread, apart) <= DUPLICATE_MAX_CHI2:
            labels.join_objects(kept, given_up)


def close_pairs(scene: SceneMap) -> list[tuple[ObjectRow, ObjectRow]]:
    """Return pairs of one class, a few sizes apart at most, that are not seen together.

    Of two classes, pairs in the same place: detectors confuse classes.
    """
    labels = scene.labels
    alive = np.flatnonzero(labels.box_counts > 0)
    alive = alive[labels.takes_part[alive]]
    if len(alive) < 2:
        return []
    size = np.exp(scene.log_sizes()[alive])
    center = scene.ellipsoids[alive, :3]
    called = labels.votes[alive].argmax(axis=1)
    distance = np.linalg.norm(center[:, None] - center, axis=2)
    near = distance < DUPLICATE_MAX_SIZES_APART * (size[:, None] + size)
    smaller, ratio = np.minimum(size[:, None], size), np.abs(np.log(size[:, None] / size))
    renamed = distance < RENAMED_MAX_SIZES_APART * smaller
    renamed &= ratio < np.log(RENAMED_MAX_SIZE_FACTOR)
    near &= (called[:, None] == called) | renamed
    pairs = alive[np.argwhere(np.triu(near, 1))].tolist()
    return [(a, b) for a, b in pairs if not _are_seen_together(scene, a, b)]


def _are_seen_together(scene: SceneMap, a: ObjectRow, b: ObjectRow) -> bool:
    """Return whether images show both of two objects, more of them than by mistake."""
    pose = scene.recording.detections.pose
    first, second = (pose[scene.labels.object_rows == row] for row in (a, b))
    together = len(np.intersect1d(first, second))
    return together > DUPLICATE_MAX_SEEN_TOGETHER * min(len(first), len(second))


def _covariance_of_difference(covariance: Floats, a: int, b: int) -> Floats:
    """Return the covariance of the difference of two points, at rows a and b of a joint one."""
    first, second = slice(a, a + 3), slice(b, b + 3)
    cross = covariance[first, second]
    return np.asarray(covariance[first, first] + covariance[second, second] - cross - cross.T)


def _shortest_half(values: Floats) -> tuple[float, float]:
    """Return the middle of the shortest half of some numbers, and a standard deviation from it.

    Nearly half of them may be wrong (Rousseeuw & Leroy 1987: the shorth).
    """
    values = np.sort(values)
    half = len(values) // 2
    first = int(np.argmin(values[half:] - values[: len(values) - half]))
    low, high = float(values[first]), float(values[first + half])
    return 0.5 * (low + high), 0.5 * (high - low) / 0.6745


def find_misfits(scene: SceneMap) -> dict[ObjectRow, str]:
    """Return objects whose size is unusual for their class, and how.

    What moves along a straight line while the camera does looks like a thing at rest, at another
    distance, hence of another size: of cars that come towards us, about half. The usual size is
    learned from the objects of a class, of traffic from those that are not half as large as they
    should be: there, most may move.
    """
    alive = np.flatnonzero(scene.labels.box_counts > 0)
    if not alive.size:  # there may be no classes either
        return {}
    log_size = scene.log_sizes()
    called = scene.labels.votes.argmax(axis=1)
    misfits: dict[ObjectRow, str] = {}
    for one in np.unique(called[alive]).tolist():
        members = alive[called[alive] == one]
        name = scene.class_names[one]
        likely = log_size[members]
        known = usual_size(name)
        if known is not None:
            likely = likely[np.abs(likely - known) < MISFIT_MAX_OFF_KNOWN]
        if len(likely) < MISFIT_MIN_OBJECTS:
            continue
        usual, spread = _shortest_half(likely)
        for row in members.tolist():
            ratio = log_size[row] - usual
            if abs(ratio) > MISFIT_MAX_SPREADS * max(spread, MISFIT_MIN_SPREAD):
                misfits[row] = (
                    f"its size is {np.exp(ratio):.2g} times the usual one of a {name}: "
                    "it moved while it was seen, or is something else"
                )
    return misfits


def find_scattered(scene: SceneMap) -> dict[ObjectRow, str]:
    """Return objects that do not explain most boxes of their own tracklets."""
    labels = scene.labels
    seen = scene.recording.detections.pose < len(scene.poses)
    owner = labels.object_of_tracklet[labels.tracklets[seen]]
    scattered: dict[ObjectRow, str] = {}
    for row in labels.shown_objects.tolist():
        share = np.sum(labels.object_rows == row) / np.sum(owner == row)
        if share < SCATTERED_MAX_SHARE:
            scattered[row] = (
                f"one place explains {share:.0%} of its boxes: it moved, or its id names several"
            )
    return scattered


def find_movers(
    scene: SceneMap, suspects: Collection[ObjectRow] | None = None
) -> dict[ObjectRow, str]:
    """Return objects, all or some ``suspects``, that are at rest only if the path bends to them.

    Each in turn is left out of the estimate. If it moved, its boxes do not fit any place then, and
    the cost that it causes, to the path and to the other objects as well, is gone. An object at
    rest may look the same as long as one that moved bends the path: the worst comes first, and the
    others are tried again without it.
    """
    labels = scene.labels
    shown = labels.shown_objects
    shown = shown[labels.takes_part[shown]]
    if len(shown) < 2:  # nothing else holds the path
        return {}
    asked = [
        row
        for row in shown.tolist()
        if (suspects is None or row in suspects)
        and np.sum(labels.object_rows == row) >= MOVER_MIN_BOXES
    ]
    fits = _fits_without(scene, asked, movers={}) if asked else {}
    movers: dict[ObjectRow, str] = {}
    for row in sorted(fits, key=lambda one: -fits[one]):
        fit = _fits_without(scene, [row], movers).get(row) if movers else fits[row]
        if fit is not None:
            movers[row] = (
                "without it, the path explains its boxes "
                f"{fit / MEDIAN_CHI2:.0f} times worse than chance: it moved"
            )
    return movers


def _fits_without(
    scene: SceneMap, object_rows: list[ObjectRow], movers: dict[ObjectRow, str]
) -> dict[ObjectRow, float]:
    """Return those of some objects that bend the path, and how their boxes fit if they may not.

    The median chi-square of an object's boxes at one place, movers taking no part.
    """
    fits: dict[ObjectRow, float] = {}
    shown = scene.labels.object_rows
    given = np.flatnonzero(shown >= 0)
    usual = float(np.median(scene.chi2(given, scene.ellipsoids[shown[given]])))
    least = max(MOVER_MIN_COST_PER_BOX, MOVER_MIN_COST_RATIO * usual)
    with_all, _ = scene.solve_without(movers, max_iterations=MOVER_MAX_ITERATIONS)
    for row in object_rows:
        rows = np.flatnonzero(shown == row)
        without, poses = scene.solve_without([*movers, row], max_iterations=MOVER_MAX_ITERATIONS)
        if 2.0 * (with_all - without) / len(rows) < least:
            continue
        ellipsoids, _ = scene.fit_groups([rows], poses)
        fit = scene.chi2(rows, np.repeat(ellipsoids, len(rows), axis=0), poses=poses)
        if np.median(fit) > MOVER_MIN_CHI2:
            fits[row] = float(np.median(fit))
    return fits
