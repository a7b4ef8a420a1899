"""Edges of boxes that a nearer object may hide.

What is seen of an object ends where a nearer one begins. The edge of its box is then where it
is seen to end, and the object itself may go on behind. An edge is where it would be without the
other object if the point at which the outline touches it is in view.
"""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.lens import outline_tilts
from dqslam.recording import Recording

# An object hides what lies in its outline, and around it, as a part of the outline's size: no
# object is an ellipsoid, and both are estimates.
MARGIN = 0.1
OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])


def hidden_edges(
    camera: _core.Camera,
    model: _core.PoseModel,
    poses: Floats,
    ellipsoids: Floats,
    shown: Bools | None = None,
) -> Bools:
    """Tell which edges of the boxes of objects (o, 9) others may hide from poses (n, d): (n, o, 4).

    The object whose center is nearer hides the other one. What is not in front of the camera is
    not hidden. With ``shown`` (n, o), objects without a flag neither hide others nor are hidden.
    """
    n, o = len(poses), len(ellipsoids)
    hidden = np.zeros((n, o, 4), dtype=np.bool_)
    if n == 0 or o < 2:
        return hidden
    here, objects = np.repeat(poses, o, axis=0), np.tile(ellipsoids, (n, 1))
    flat, in_front = _core.project_to_boxes(model, camera, here, objects)
    box = np.where(in_front[:, None], flat, np.nan).reshape(n, o, 4)
    eyes = _core.world_from_camera(model, camera, poses)[:, :3]
    distance = np.linalg.norm(ellipsoids[:, :3] - eyes[:, None], axis=2)
    reach = MARGIN * np.tile(box[..., 2:] - box[..., :2], 2) * (0.5 * OUTWARD)
    wide = box + reach
    with np.errstate(invalid="ignore"):
        meets = distance[:, None, :] < distance[:, :, None]
        for axis in (0, 1):
            meets &= wide[:, None, :, axis] < box[:, :, None, axis + 2]
            meets &= wide[:, None, :, axis + 2] > box[:, :, None, axis]
    if shown is not None:
        meets &= shown[:, :, None] & shown[:, None, :]
    image, far, near = np.nonzero(meets)
    if not image.size:
        return hidden
    pairs = np.concatenate([image * o + far, image * o + near])
    places, back = np.unique(pairs, return_inverse=True)
    tilts = outline_tilts(model, camera, here[places], objects[places])[back]
    far_tilt, near_tilt = tilts[: len(image)], tilts[len(image) :]
    points = _touching_points(box[image, far], far_tilt)
    covered = _are_inside(points, box[image, near], near_tilt)
    np.logical_or.at(hidden, (image, far), covered)
    return hidden


def shortened_edges(
    recording: Recording, poses: Floats, ellipsoids: Floats, object_row: Ints, variance: Floats
) -> Bools:
    """Tell which edges of the boxes of a recording others seem to hide, (m, 4).

    These may be hidden, and the box ends before the object by more than its noise: some detectors
    draw what they do not see, too. A box of what should be wholly hidden says that something else
    is wrong: none of its edges is flagged.

    Parameters
    ----------
    poses, ellipsoids
        What is estimated, (n, d) and (o, 9).
    object_row
        Object of each box, -1 for none, shape (m,).
    variance
        Of the edges of boxes, pixels squared, shape (m, 4).
    """
    camera, model = recording.camera, recording.odometry.pose_model
    flags = np.zeros((len(object_row), 4), dtype=np.bool_)
    rows = np.flatnonzero(object_row >= 0)
    pose, object_row = recording.detections.pose[rows], object_row[rows]
    used, place = np.unique(pose, return_inverse=True)
    hidden = hidden_edges(camera, model, poses[used], ellipsoids)[place, object_row]
    hidden &= ~hidden.all(axis=1, keepdims=True)
    some = np.flatnonzero(hidden.any(axis=1))
    whole, _ = _core.project_to_boxes(
        model, camera, poses[pose[some]], ellipsoids[object_row[some]]
    )
    short = (whole - recording.detections.box[rows[some]]) * OUTWARD
    flags[rows[some]] = hidden[some] & (short > np.sqrt(variance[rows[some]]))
    return flags


def _touching_points(box: Floats, tilt: Floats) -> Floats:
    """Return where outlines touch the edges of their boxes (p, 4), (p, 4, 2)."""
    middle, half = 0.5 * (box[:, :2] + box[:, 2:]), 0.5 * (box[:, 2:] - box[:, :2])
    one = np.ones(len(box))
    unit = np.stack([[-one, -tilt], [-tilt, -one], [one, tilt], [tilt, one]])  # (4, 2, p)
    return np.asarray(middle[:, None] + unit.transpose(2, 0, 1) * half[:, None])


def _are_inside(points: Floats, box: Floats, tilt: Floats) -> Bools:
    """Tell which points (p, k, 2) lie in outlines of boxes (p, 4), or in the margin: (p, k)."""
    middle, half = 0.5 * (box[:, :2] + box[:, 2:]), 0.5 * (box[:, 2:] - box[:, :2])
    u, v = ((points - middle[:, None]) / ((1.0 + MARGIN) * half[:, None])).transpose(2, 0, 1)
    tilt = tilt[:, None]
    return np.asarray(u**2 - 2.0 * tilt * u * v + v**2 <= 1.0 - tilt**2)
