"""The motion that brings an estimate into the world of the truth.

Rotations and poses follow ``blocks.h``: world_from_camera, [tx ty tz qx qy qz qw], meters.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from dqslam._checks import Floats, as_floats

Align = Literal["none", "se2", "se3", "sim3"]


@dataclass(frozen=True, eq=False)
class Alignment:
    """A motion true_from_estimated, x -> scale rotation x + translation."""

    rotation: Floats
    """Shape (k, k)."""
    translation: Floats
    """Meters, shape (k,)."""
    scale: float = 1.0

    def apply(self, points: Floats) -> Floats:
        """Move points, shape (n, k)."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    def apply_poses(self, poses: Floats) -> Floats:
        """Move poses, shape (n, 7)."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_matrix(self.rotation) * Rotation.from_quat(poses[:, 3:])
        return np.column_stack([self.apply(poses[:, :3]), turned.as_quat()])


def align_rigid(points: Floats, true_points: Floats) -> Alignment:
    """Find the rigid motion, without scale, that brings points nearest to the true ones.

    This is Umeyama's closed form of least squares. Both have shape (n, k), with k = 2 for SE(2) and
    3 for SE(3). If all points lie on a line (k = 3), the rotation about that line is arbitrary.
    """
    return _umeyama(points, true_points, with_scale=False)


def align_positions(points: Floats, true_points: Floats, align: Align = "se3") -> Alignment:
    """Find the motion of a kind that brings positions nearest to the true ones, shape (n, 3).

    "se3" is a rigid motion, "sim3" a rigid motion with a scale, "se2" a motion in the x-y plane
    that keeps heights, and "none" no motion.
    """
    points, true_points = same_shape(points, true_points)
    if points.shape[1] != 3:
        raise ValueError(f"positions: expected shape (n, 3), got {points.shape}")
    _check_kind(align)
    if align == "none":
        return Alignment(np.eye(3), np.zeros(3))
    if align == "se2":
        return _lifted(_umeyama(points[:, :2], true_points[:, :2], with_scale=False))
    return _umeyama(points, true_points, with_scale=align == "sim3")


def align_poses(
    poses: Floats, true_poses: Floats, align: Align = "se3", *, lever: float
) -> Alignment:
    """Find the motion of a kind that brings poses, not positions alone, nearest to the true ones.

    Over all poses, it minimizes the squared distances of the position and of the six points at
    ``lever`` meters along the axes of the camera. One of these is ahead of the camera, where
    objects are. Hence every rotation is determined, even about a straight path.

    Parameters
    ----------
    poses, true_poses
        Shape (n, 7).
    align
        As in ``align_positions``; the scale of "sim3" comes from the positions.
    lever
        Distance of the six points from the cameras, meters.
    """
    from scipy.spatial.transform import Rotation

    poses = as_floats("poses", poses, [None, 7])
    true_poses = as_floats("true poses", true_poses, [None, 7])
    points, true_points = same_shape(poses[:, :3], true_poses[:, :3])
    if not (np.isfinite(lever) and lever > 0.0):
        raise ValueError(f"lever: expected a positive distance, got {lever:g}")
    _check_kind(align)
    if align == "none":
        return Alignment(np.eye(3), np.zeros(3))
    size = 2 if align == "se2" else 3
    scale = 1.0
    if align == "sim3":
        scale = _umeyama(points, true_points, with_scale=True).scale
    middle, true_middle = scale * points[:, :size].mean(axis=0), true_points[:, :size].mean(axis=0)
    turns, true_turns = (Rotation.from_quat(p[:, 3:]).as_matrix() for p in (poses, true_poses))
    # For the six points p +- lever R e_k, the terms with p add up to 6 p and those with R to R R^T.
    correlation = (
        7.0 * (true_points[:, :size] - true_middle).T @ (scale * points[:, :size] - middle)
        + 2.0 * lever**2 * np.einsum("nij,nkj->ik", true_turns, turns)[:size, :size]
    )
    rotation, _ = _nearest_rotation(correlation)
    found = Alignment(rotation, true_middle - rotation @ middle, scale)
    return _lifted(found) if align == "se2" else found


def same_shape(points: Floats, true_points: Floats) -> tuple[Floats, Floats]:
    """Return two tables after a check that they have the same shape (n, k), n at least 1."""
    points = as_floats("estimated points", points, [None, None])
    true_points = as_floats("true points", true_points, [None, None])
    if points.shape != true_points.shape:
        raise ValueError(
            f"estimated and true points differ in shape: {points.shape}, {true_points.shape}"
        )
    if not len(points):
        raise ValueError("there are no points to compare")
    return points, true_points


def _check_kind(align: str) -> None:
    if align not in get_args(Align):
        raise ValueError(f'align: expected "none", "se2", "se3" or "sim3", got {align!r}')


def _umeyama(points: Floats, true_points: Floats, *, with_scale: bool) -> Alignment:
    points, true_points = same_shape(points, true_points)
    if len(points) < 2:
        raise ValueError(f"alignment: expected two points or more, got {len(points)}")
    middle, true_middle = points.mean(axis=0), true_points.mean(axis=0)
    rotation, trace = _nearest_rotation((true_points - true_middle).T @ (points - middle))
    scale = 1.0
    if with_scale:
        spread = float(np.sum((points - middle) ** 2))
        scale = trace / spread if spread > 0.0 else 0.0
        if not scale > 0.0:
            raise ValueError("alignment: the points do not move, so that they have no scale")
    return Alignment(rotation, true_middle - scale * rotation @ middle, scale)


def _nearest_rotation(correlation: Floats) -> tuple[Floats, float]:
    """Return the rotation R, (k, k), that maximizes trace(R^T correlation), and the maximum."""
    u, values, vt = np.linalg.svd(correlation)
    no_mirror = np.ones(len(values))
    no_mirror[-1] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((u * no_mirror) @ vt), float(no_mirror @ values)


def _lifted(on_plane: Alignment) -> Alignment:
    """Return a motion of the x-y plane as one of space that keeps heights."""
    rotation, translation = np.eye(3), np.zeros(3)
    rotation[:2, :2], translation[:2] = on_plane.rotation, on_plane.translation
    return Alignment(rotation, translation)
