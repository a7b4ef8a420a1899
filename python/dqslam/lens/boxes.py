"""Boxes in the image as recorded, and those of the same objects in the pinhole's image.

The outline of an ellipsoid in the pinhole's image is an ellipse. The lens bends it, and a detector
bounds the bent outline: an edge touches it at one point, which is not where the edge of the
pinhole's box touches the ellipse. An ellipse is five numbers: its box, and its *tilt*, the
correlation of its points,

    u = middle_u + half_width cos(t),
    v = middle_v + half_height (tilt cos(t) + sqrt(1 - tilt^2) sin(t)).

With the tilt, box and recorded box determine each other. Where nothing is known of the object, it
is that of an outline whose axes are those of the image as recorded; an estimate knows it, and with
it boxes are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, as_floats, reject_rows
from dqslam.lens.camera import differentiate_pixels, ideal_pixels, recorded_pixels

# Points of an outline among which the touching points are looked for.
_POINTS = 24
# Rounds of Newton's method for a touching point, each with a step for its second derivative; it is
# found when its angle moves by less, for the edge depends on the square of that.
_ROUNDS = 3
_STEP = 1e-5
_FOUND = 1e-6
# Rounds for a box; from the start used here, four or five reach the accuracy [px].
_BOX_ROUNDS = 40
_ACCURACY = 1e-8
_FARTHEST_TILT = 0.9999
_SIGNS = np.array([-1.0, -1.0, 1.0, 1.0])


def undistort_boxes(camera: _core.Camera, recorded: ArrayLike, tilt: ArrayLike = np.nan) -> Floats:
    """Return the boxes (m, 4) in the pinhole's image of the outlines that boxes (m, 4) bound.

    ``tilt`` is that of each outline, shape (m,), or one for all; NaN takes the
    axes of the outline as recorded for those of the image.

    Raises
    ------
    ValueError
        If a box reaches beyond the range of the lens, with its row.
    """
    boxes = as_floats("boxes", recorded, [None, 4])
    if not camera.has_distortion:
        return boxes
    found = undistorted_or_nan(camera, boxes, tilt)
    reject_rows("boxes", np.isnan(found), "it reaches beyond the range of the lens", boxes)
    return found


def distort_boxes(camera: _core.Camera, undistorted: ArrayLike, tilt: ArrayLike = np.nan) -> Floats:
    """Return the boxes (m, 4) as recorded of outlines by their boxes (m, 4) in the pinhole's image.

    This inverts ``undistort_boxes``. ``tilt`` is as there.

    Raises
    ------
    ValueError
        If an outline reaches beyond the range of the lens, with its row.
    """
    boxes = as_floats("boxes", undistorted, [None, 4])
    if not camera.has_distortion:
        return boxes
    recorded = distorted_or_nan(camera, boxes, tilt)
    reject_rows("boxes", np.isnan(recorded), "it reaches beyond the range of the lens", boxes)
    return recorded


def distorted_or_nan(camera: _core.Camera, undistorted: Floats, tilt: ArrayLike = np.nan) -> Floats:
    """Return what ``distort_boxes`` does, and NaN for outlines beyond the range of the lens."""
    tilts = _given_tilts(tilt, len(undistorted)).copy()
    rows = np.flatnonzero(np.isnan(tilts))
    tilts[rows] = 0.0
    recorded, _, _, touching = _recorded(camera, undistorted, tilts)
    touching = touching[rows]
    slope = _straight_slopes(camera, recorded[rows])
    for _ in range(_BOX_ROUNDS):
        if not rows.size:
            break
        # The tilt depends on the recorded box, and this on the tilt: Newton's method.
        tilts[rows] = _straight_tilts(camera, recorded[rows])
        after, _, by_tilt, touching = _recorded(camera, undistorted[rows], tilts[rows], touching)
        change = after - recorded[rows]
        with np.errstate(invalid="ignore", divide="ignore"):
            along = np.sum(slope * change, axis=1) / (1 - np.sum(slope * by_tilt, axis=1))
        recorded[rows] += change + along[:, None] * by_tilt
        left = np.abs(change).max(axis=1, initial=0.0) > _ACCURACY  # false for NaN
        rows, slope, touching = rows[left], slope[left], touching[left]
    recorded[np.isnan(recorded).any(axis=1)] = np.nan
    recorded[rows] = np.nan
    return recorded


def undistorted_or_nan(
    camera: _core.Camera,
    recorded: Floats,
    tilt: ArrayLike = np.nan,
    *,
    near: Floats | None = None,
) -> Floats:
    """Return what ``undistort_boxes`` does, and NaN for boxes beyond the range of the lens.

    ``near`` (m, 4) are boxes that are near those looked for, where such are known.
    """
    tilts = _given_tilts(tilt, len(recorded)).copy()
    unknown = np.flatnonzero(np.isnan(tilts))
    tilts[unknown] = _straight_tilts(camera, recorded[unknown])
    box = _start(camera, recorded) if near is None else near.copy()
    found = np.full_like(box, np.nan)
    rows = np.flatnonzero(np.isfinite(box).all(axis=1) & np.isfinite(tilts))
    touching = None
    for _ in range(_BOX_ROUNDS):
        now, jacobian, _, touching = _recorded(camera, box[rows], tilts[rows], touching)
        known = np.isfinite(now).all(axis=1)
        rows, error, jacobian = rows[known], (recorded[rows] - now)[known], jacobian[known]
        done = np.abs(error).max(axis=1, initial=0.0) < _ACCURACY
        found[rows[done]] = box[rows[done]]
        rows, error, jacobian = rows[~done], error[~done], jacobian[~done]
        touching = touching[known][~done]
        if not rows.size:
            break
        change = np.linalg.solve(jacobian, error[..., None])[..., 0]
        # A longer step could turn the box inside out.
        side = np.tile(box[rows, 2:] - box[rows, :2], (1, 2))
        longest = np.abs(change / side).max(axis=1)
        box[rows] += change * np.minimum(1.0, 0.25 / np.maximum(longest, 0.25))[:, None]
    return found


def edge_scales(camera: _core.Camera, boxes: Floats) -> Floats:
    """Return pixels of the pinhole for each recorded pixel at the edges of boxes, shape (m, 4).

    ``boxes`` (m, 4) are those of the pinhole. A scale is that across the edge, at its middle; NaN
    beyond the range of the lens.
    """
    if not camera.has_distortion:
        return np.ones((len(boxes), 4))
    middles = np.tile([np.pi, -np.pi / 2, 0.0, np.pi / 2], (len(boxes), 1))
    _, gradient, _ = _edges(camera, boxes, np.zeros(len(boxes)), middles)
    return np.asarray(1.0 / np.linalg.norm(gradient, axis=-1))


def outline_tilts(
    model: _core.PoseModel, camera: _core.Camera, poses: Floats, ellipsoids: Floats
) -> Floats:
    """Return the tilt of the outline of ellipsoid i (n, 9) from pose i (n, d), shape (n,).

    It is NaN where the ellipsoid is not strictly in front of the camera.
    """
    # Five points of an outline are the ends of its axes, and the first one again.
    ends = _core.project_to_outlines(model, camera, poses, ellipsoids, points=5)
    axes = 0.5 * (ends[:, :2] - ends[:, 2:4])
    spread = np.einsum("nki,nkj->nij", axes, axes)
    with np.errstate(invalid="ignore", divide="ignore"):
        tilt = spread[:, 0, 1] / np.sqrt(spread[:, 0, 0] * spread[:, 1, 1])
    return np.asarray(np.clip(tilt, -_FARTHEST_TILT, _FARTHEST_TILT))


def _given_tilts(tilt: ArrayLike, count: int) -> Floats:
    tilts = np.broadcast_to(np.asarray(tilt, dtype=np.float64), (count,))
    reject_rows("tilt", np.abs(tilts) >= 1.0, "not between -1 and 1", tilts)
    return tilts


def _straight_tilts(camera: _core.Camera, recorded: Floats) -> Floats:
    """Return the tilts (m,) of outlines whose axes are those of the image as recorded.

    The lens is taken for linear around the middle of the recorded box.
    """
    half = 0.5 * (recorded[:, 2:] - recorded[:, :2])
    middle = ideal_pixels(camera, 0.5 * (recorded[:, :2] + recorded[:, 2:]))
    _, jacobian = differentiate_pixels(camera, middle)
    (a, b), (c, d) = jacobian.transpose(1, 2, 0)
    # The rows of the inverse of [a b; c d], up to its determinant, times the half sides.
    x, y = np.column_stack([d, -b]) * half, np.column_stack([-c, a]) * half
    norm = np.linalg.norm(x, axis=1) * np.linalg.norm(y, axis=1)
    tilt = np.sum(x * y, axis=1) / norm
    return np.asarray(np.clip(tilt, -_FARTHEST_TILT, _FARTHEST_TILT))


def _straight_slopes(camera: _core.Camera, recorded: Floats) -> Floats:
    """Return the derivatives (m, 4) of these tilts by the recorded boxes."""
    steps = 1e-4 * np.eye(4)
    change = [
        _straight_tilts(camera, recorded + step) - _straight_tilts(camera, recorded - step)
        for step in steps
    ]
    return np.stack(change, axis=1) / 2e-4


def _start(camera: _core.Camera, recorded: Floats) -> Floats:
    """Return the boxes (m, 4) of what the ellipses in recorded boxes are in the pinhole's image."""
    angle = np.linspace(0.0, 2 * np.pi, _POINTS, endpoint=False)
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    middle, half = (recorded[:, :2] + recorded[:, 2:]) / 2, (recorded[:, 2:] - recorded[:, :2]) / 2
    ideal = ideal_pixels(camera, middle[:, None] + half[:, None] * unit)
    return np.concatenate([ideal.min(axis=1), ideal.max(axis=1)], axis=1)


def _points(boxes: Floats, tilts: Floats, angles: Floats) -> tuple[Floats, Floats]:
    """Return points (m, k, 2) of outlines by their angles (m, k), and the derivatives by these."""
    middle, half = (boxes[:, :2] + boxes[:, 2:]) / 2, (boxes[:, 2:] - boxes[:, :2]) / 2
    tilt = tilts[:, None]
    across = np.sqrt(1 - tilt**2)
    c, s = np.cos(angles), np.sin(angles)
    unit = np.stack([c, tilt * c + across * s], axis=-1)
    slope = np.stack([-s, -tilt * s + across * c], axis=-1)
    return middle[:, None] + half[:, None] * unit, half[:, None] * slope


def _touching(
    camera: _core.Camera, boxes: Floats, tilts: Floats, near: Floats | None = None
) -> Floats:
    """Return the angles (m, 4) at which recorded edges touch the outlines, from some ``near``."""
    angle = np.linspace(0.0, 2 * np.pi, _POINTS, endpoint=False)
    farthest = angle[1]  # the extreme is next to the best of the points
    angles = near
    if angles is None:
        points, _ = _points(boxes, tilts, np.tile(angle, (len(boxes), 1)))
        recorded = np.tile(recorded_pixels(camera, points), (1, 1, 2)) * _SIGNS
        angles = angle[np.where(np.isnan(recorded), -np.inf, recorded).argmax(axis=1)]
    for _ in range(_ROUNDS):
        slope, after = (_slopes(camera, boxes, tilts, angles + step) for step in (0.0, _STEP))
        with np.errstate(invalid="ignore", divide="ignore"):
            newton = -slope * _STEP / (after - slope)
        uphill = np.sign(slope) * farthest
        change = np.where(after < slope, np.clip(newton, -farthest, farthest), uphill)
        change = np.nan_to_num(change)
        angles = angles + change
        if np.abs(change).max(initial=0.0) < _FOUND:
            break
    return angles


def _slopes(camera: _core.Camera, boxes: Floats, tilts: Floats, angles: Floats) -> Floats:
    """Return the derivatives (m, 4) of the outward edges by the angles of their points."""
    _, gradient, along = _edges(camera, boxes, tilts, angles)
    return np.asarray(_SIGNS * np.sum(gradient * along, axis=-1))


def _edges(
    camera: _core.Camera, boxes: Floats, tilts: Floats, angles: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return recorded edges (m, 4), their gradients, and the outline's tangents, (m, 4, 2)."""
    points, along = _points(boxes, tilts, angles)
    recorded, jacobian = differentiate_pixels(camera, points)
    edge = np.arange(4)
    return recorded[:, edge, edge % 2], jacobian[:, edge, edge % 2], along


def _recorded(
    camera: _core.Camera, boxes: Floats, tilts: Floats, near: Floats | None = None
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return recorded boxes (m, 4), and their derivatives by boxes (m, 4, 4) and tilts (m, 4).

    Also the angles (m, 4) at which edges touch the outline, which are near those that are given.
    An edge is an extreme of the outline, so that only the outline's motion at the touching point
    counts, and not that of the point along it.
    """
    touching = _touching(camera, boxes, tilts, near)
    unit, _ = _points(np.tile([-1.0, -1.0, 1.0, 1.0], (len(boxes), 1)), tilts, touching)
    recorded, gradient, _ = _edges(camera, boxes, tilts, touching)
    low, high = 0.5 * gradient * (1 - unit), 0.5 * gradient * (1 + unit)
    turn = np.cos(touching) - (tilts / np.sqrt(1 - tilts**2))[:, None] * np.sin(touching)
    by_tilt = gradient[..., 1] * turn * 0.5 * (boxes[:, 3] - boxes[:, 1])[:, None]
    return recorded, np.concatenate([low, high], axis=-1), by_tilt, touching
