"""Boxes of solids in the image, and how well detected boxes fit them, by the core."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.solids.solids import Solids


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
    boxes[rows], in_front[rows] = _core.project_bodies_to_boxes(
        model, camera, poses[rows], *_bodies(solids.take(rows))
    )
    return boxes, in_front


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
    chi2[rows] = _core.body_chi_squares(
        model,
        camera,
        poses[rows],
        *_bodies(solids.take(rows)),
        boxes[rows],
        covariances[rows],
        truncated[rows],
    )
    return chi2


def _bodies(solids: Solids) -> tuple[list[_core.Shape], Floats, Floats]:
    """Return cuboids and cylinders as the core takes them."""
    return list(solids.shapes), solids.centers, solids.factors.reshape(-1, 9)
