"""Outlines of solids in the image and from above."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.solids.projection import in_camera
from dqslam.solids.solids import Solids, hull_points


def project_to_outlines(
    model: _core.PoseModel,
    camera: _core.Camera,
    poses: Floats,
    solids: Solids,
    *,
    points: int = 128,
) -> Floats:
    """Return the outline of solid i from pose i (m, d), undistorted pixels, (m, points, 2).

    The last point is the first one again; NaN where a solid is not strictly in front. A cuboid's
    outline has all its corners, so that ``points`` must be at least 8.
    """
    outlines = _core.project_to_outlines(model, camera, poses, solids.ellipsoids, points=points)
    rows = np.flatnonzero(solids.is_body)
    bodies = solids.take(rows)
    centers, factors = in_camera(model, camera, poses[rows], bodies)
    for row, shape, center, factor in zip(rows, bodies.shapes, centers, factors, strict=True):
        hull = center + hull_points(shape, (points - 1) // 2) @ factor.T
        outlines[row] = np.nan
        if (hull[:, 2] > 0.0).all():
            pixels = hull[:, :2] / hull[:, 2:]
            pixels = pixels * [camera.fx, camera.fy] + [camera.cx, camera.cy]
            outlines[row] = around(pixels, points)
    return np.asarray(outlines)


def around(points: Floats, count: int) -> Floats:
    """Return the closed line around points (n, 2), with as many points as asked for, (count, 2).

    It has all corners of the hull, at most count - 1, and further points along its sides.
    """
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    sides = np.roll(corners, -1, axis=0) - corners
    # Further points go to the sides, one by one, where the parts are longest.
    parts = np.ones(len(corners), dtype=np.int64)
    lengths = np.linalg.norm(sides, axis=1)
    for _ in range(count - 1 - len(corners)):
        parts[np.argmax(lengths / parts)] += 1
    line = [
        corner + np.arange(part)[:, None] / part * side
        for corner, side, part in zip(corners, sides, parts, strict=True)
    ]
    return np.vstack([*line, corners[:1]])


def flat_outline(solids: Solids, row: int, axes: Floats) -> Floats:
    """Return the outline of a cuboid or a cylinder on a plane, (2, n), seen along its normal.

    ``axes`` are the directions on the plane, shape (2, 3).
    """
    from scipy.spatial import ConvexHull

    hull = solids.centers[row] + hull_points(solids.shapes[row]) @ solids.factors[row].T
    flat = hull @ axes.T
    corners = flat[ConvexHull(flat).vertices]
    return np.asarray(np.vstack([corners, corners[:1]]).T)
