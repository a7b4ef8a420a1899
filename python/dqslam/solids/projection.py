"""Boxes of solids in the image, and how well detected boxes fit them.

The core projects ellipsoids, and solves problems with bodies. Here are the boxes that it predicts
for cuboids and cylinders, with edges as little rounded as in its ``body.h``.
"""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import Shape
from dqslam.solids.solids import Solids

#: Each absolute value |v_i| in the width of a body is rounded within this share of |v|.
ROUNDING = 0.02
_MAX_STEPS = 30
_OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])


def in_camera(
    model: _core.PoseModel, camera: _core.Camera, poses: Floats, solids: Solids
) -> tuple[Floats, Floats]:
    """Return center (m, 3) and factor (m, 3, 3) of solid i in the camera at pose i, (m, d)."""
    from scipy.spatial.transform import Rotation

    world_from_camera = _core.world_from_camera(model, camera, poses)
    turns = Rotation.from_quat(world_from_camera[:, 3:]).as_matrix().reshape(-1, 3, 3)
    centers = np.einsum("mji,mj->mi", turns, solids.centers - world_from_camera[:, :3])
    return centers, turns.transpose(0, 2, 1) @ solids.factors


def project_to_boxes(
    model: _core.PoseModel, camera: _core.Camera, poses: Floats, solids: Solids
) -> tuple[Floats, Bools]:
    """Return the box of solid i from pose i (m, d), undistorted pixels, (m, 4).

    And whether it is strictly in front of the camera, (m,); the box is NaN where it is not.
    """
    boxes, in_front = _core.project_to_boxes(model, camera, poses, solids.ellipsoids)
    rows = np.flatnonzero(solids.is_body)
    boxes[rows], in_front[rows], _ = _project_bodies(model, camera, poses[rows], solids.take(rows))
    return boxes, np.asarray(in_front)


def box_chi_squares(
    model: _core.PoseModel,
    camera: _core.Camera,
    poses: Floats,
    solids: Solids,
    boxes: Floats,
    covariances: Floats,
    truncated: Bools,
) -> Floats:
    """Return chi-squares (m,), 4 degrees of freedom, of boxes for solid i from pose i (m, d).

    Parameters
    ----------
    boxes
        Undistorted pixels, shape (m, 4).
    covariances
        Pixels squared, shape (m, 16).
    truncated
        Edges that the border of the image cuts, shape (m, 4). Like the core, such a box compares
        these edges, and those that the solid touches outside the image, only where the prediction
        ends inside. Infinite unless the solid is strictly in front.
    """
    chi2 = _core.box_chi_squares(
        model, camera, poses, solids.ellipsoids, boxes, covariances, truncated
    )
    rows = np.flatnonzero(solids.is_body)
    predicted, in_front, touching = _project_bodies(model, camera, poses[rows], solids.take(rows))
    last = np.array([camera.width, camera.height]) - 0.5
    is_seen = ((touching >= -0.5) & (touching <= last)).all(axis=2)
    is_cut = np.any(truncated[rows], axis=1, keepdims=True)
    one_sided = truncated[rows] | (is_cut & ~is_seen)
    error = predicted - boxes[rows]
    error = np.where(one_sided & (error * _OUTWARD > 0.0), 0.0, error)
    whitened = np.linalg.solve(covariances[rows].reshape(-1, 4, 4), error[:, :, None])
    squares = np.einsum("mi,mi->m", error, whitened[:, :, 0])
    chi2[rows] = np.where(in_front, squares, np.inf)
    return np.asarray(chi2)


def _project_bodies(
    model: _core.PoseModel, camera: _core.Camera, poses: Floats, bodies: Solids
) -> tuple[Floats, Bools, Floats]:
    """Return boxes (m, 4), what is in front (m,), and the pixel that touches each edge, (m, 4, 2).

    The line x = u / z through an edge is the zero of outward (c_u - x c_z) + width(A_u - x A_z),
    with the rows of A. It is found by Newton's method from the center.
    """
    centers, factors = in_camera(model, camera, poses, bodies)
    is_cuboid = np.array([shape == Shape.CUBOID for shape in bodies.shapes], dtype=np.bool_)
    in_front = centers[:, 2] > _width(is_cuboid, factors[:, 2])[0]
    boxes = np.full((len(bodies), 4), np.nan)
    touching = np.full((len(bodies), 4, 2), np.nan)
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    c, a, is_cuboid = centers[in_front], factors[in_front], is_cuboid[in_front]
    for edge, outward in enumerate(_OUTWARD):
        axis = edge % 2
        x = c[:, axis] / c[:, 2]
        for _ in range(_MAX_STEPS):
            width, u = _width(is_cuboid, a[:, axis] - x[:, None] * a[:, 2])
            depth = c[:, 2] + outward * np.einsum("mi,mi->m", a[:, 2], u)
            change = (outward * (c[:, axis] - x * c[:, 2]) + width) / depth
            x = x + outward * change
            if (np.abs(change) < 1e-13 * (1.0 + np.abs(x))).all():
                break
        boxes[in_front, edge] = focal[axis] * x + middle[axis]
        point = c + outward * np.einsum("mij,mj->mi", a, u)
        touching[in_front, edge] = focal * point[:, :2] / point[:, 2:] + middle
    return boxes, in_front, touching


def _width(is_cuboid: Bools, v: Floats) -> tuple[Floats, Floats]:
    """Return the widths (m,) of bodies along normals with v = A^T n (m, 3), and d width / d v.

    An absolute value |v_i| is rounded to v_i^2 / sqrt(v_i^2 + ROUNDING^2 |v|^2). A cuboid has one
    for each axis, a cylinder one of the two axes across and one along its axis.
    """
    squares = v**2
    across = squares[:, :2].sum(axis=1)
    parts = np.where(is_cuboid[:, None], squares, np.stack([across, across, squares[:, 2]], axis=1))
    e = (ROUNDING**2 * squares.sum(axis=1))[:, None]
    root = np.sqrt(np.maximum(parts + e, np.finfo(np.float64).tiny))
    counts = np.where(is_cuboid[:, None], 1.0, [1.0, 0.0, 1.0])  # the two across are one part
    width = np.sum(counts * parts / root, axis=1)
    by_e = -np.sum(counts * parts / root**3, axis=1)[:, None]
    gradient = v * (parts + 2.0 * e) / root**3 + ROUNDING**2 * v * by_e
    return width, gradient
