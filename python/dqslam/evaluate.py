"""Errors of an estimate against the truth, as numbers with units."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dqslam._checks import Floats, Ints, as_floats
from dqslam._core import PoseModel
from dqslam.estimate import Estimate
from dqslam.recording import Truth


@dataclass(frozen=True)
class Report:
    """Errors of an estimate, as the paper defines them ([S&M17] section 5.2).

    The paper calls its first two metrics RMSE; they are mean distances, without alignment.
    """

    rmse_pos: float
    """Mean distance of the poses from their true places, metres."""
    odometry_rmse_pos: float
    """The same for odometry alone, metres."""
    rmse_landmark: float
    """Mean distance of the mapped objects' centres from their true places, metres."""
    rmse_volume: float
    """Mean absolute error of the mapped objects' volumes, cubic metres; of the paper's volume."""
    mapped: int
    """Objects of the estimate."""
    not_ellipsoids: int
    """Mapped objects whose dual quadric is no ellipsoid."""
    volume_relative_errors: tuple[float, ...] = ()
    """|error| / truth of our own volume of each mapped object that is an ellipsoid."""

    def __str__(self) -> str:
        """Show one line per error."""
        relative = np.median(self.volume_relative_errors) if self.volume_relative_errors else np.nan
        return (
            f"position error  {self.rmse_pos:8.3f} m   (odometry {self.odometry_rmse_pos:.3f} m)\n"
            f"object centres  {self.rmse_landmark:8.3f} m   ({self.mapped} objects, "
            f"{self.not_ellipsoids} of them no ellipsoid)\n"
            f"object volumes  {self.rmse_volume:8.3f} m^3"
            f"   (our own volumes: {relative:.0%} off)"
        )


def evaluate(estimate: Estimate, truth: Truth) -> Report:
    """Compare an estimate with the truth, object by object id, without any alignment."""
    rows = true_rows(estimate.object_ids, truth)
    volume_errors = np.abs(cube_volumes(estimate.shapes) - truth.volume[rows])
    real = estimate.is_ellipsoid
    volumes_of = box_volumes if truth.ellipsoids is None else ellipsoid_volumes
    relative_errors = np.abs(volumes_of(estimate.shapes[real]) / truth.volume[rows][real] - 1.0)
    return Report(
        rmse_pos=position_error(truth.pose_model, estimate.poses, truth.poses),
        odometry_rmse_pos=position_error(truth.pose_model, estimate.initial_poses, truth.poses),
        rmse_landmark=mean_distance(estimate.centers, truth.center[rows]),
        rmse_volume=float(volume_errors.mean()),
        mapped=len(rows),
        not_ellipsoids=int((~real).sum()),
        volume_relative_errors=tuple(relative_errors.tolist()),
    )


def position_error(pose_model: PoseModel, poses: Floats, true_poses: Floats) -> float:
    """Return RMSE_pos: the mean distance [m] between poses, on the plane for SE(2); no alignment.

    Both of shape (n, d).
    """
    axes = 2 if pose_model == PoseModel.SE2 else 3
    return mean_distance(np.asarray(poses)[:, :axes], np.asarray(true_poses)[:, :axes])


def mean_distance(points: Floats, true_points: Floats) -> float:
    """Return the mean distance between rows of two tables of the same shape (n, k)."""
    points, true_points = _same_shape(points, true_points)
    return float(np.linalg.norm(points - true_points, axis=1).mean())


def cube_volumes(shapes: Floats) -> Floats:
    """Return the paper's volume [m^3] of each quadric, from shapes S [m^2] of shape (o, 3, 3).

    It is that of the cube whose side is the smallest full axis, 2 sqrt(smallest eigenvalue of S).
    A quadric that is no ellipsoid has negative eigenvalues and no such axis; as the paper gives no
    rule for it, the square root of the absolute value stands in, so that it counts.
    """
    smallest = np.linalg.eigvalsh(shapes)[:, 0]
    return np.asarray((2.0 * np.sqrt(np.abs(smallest))) ** 3)


def ellipsoid_volumes(shapes: Floats) -> Floats:
    """Return the volume [m^3] of each ellipsoid, from shapes S [m^2] of shape (o, 3, 3)."""
    return np.asarray(4.0 / 3.0 * np.pi * np.sqrt(np.linalg.det(shapes)))


def box_volumes(shapes: Floats) -> Floats:
    """Return the volume [m^3] of the upright box-shaped object that each ellipsoid was fitted to.

    From shapes S [m^2] of shape (o, 3, 3), in a world whose z axis is up. An upright box of ground
    l x w, seen from all around, is (l + w) / pi half as wide in the mean, and so is the ellipsoid
    that has the same outlines: its horizontal semi-axes are 4 / pi times the half sides (l = w),
    or the geometric mean of both nearly so. Its height is the box's own, 2 sqrt(S_zz).
    """
    across = np.sqrt(np.linalg.det(shapes[:, :2, :2]))  # product of the ground's semi-axes
    return np.asarray(8.0 * (np.pi / 4.0) ** 2 * across * np.sqrt(shapes[:, 2, 2]))


@dataclass(frozen=True, eq=False)
class Alignment:
    """A rigid motion true_from_estimated."""

    rotation: Floats
    """Shape (k, k)."""
    translation: Floats
    """Metres, shape (k,)."""

    def apply(self, points: Floats) -> Floats:
        """Move points, shape (n, k)."""
        return np.asarray(points @ self.rotation.T + self.translation)


def align_rigid(points: Floats, true_points: Floats) -> Alignment:
    """Find the rigid motion, without scale, that brings points nearest to the true ones.

    Umeyama's closed form of least squares; both of shape (n, k), k = 2 for SE(2), 3 for SE(3).
    Where all points lie on a line (k = 3), the turn about that line is arbitrary.
    """
    points, true_points = _same_shape(points, true_points)
    count, size = points.shape
    if count < 2:
        raise ValueError(f"alignment: expected two points or more, got {count}")
    middle, true_middle = points.mean(axis=0), true_points.mean(axis=0)
    u, _, vt = np.linalg.svd((true_points - true_middle).T @ (points - middle))
    no_mirror = np.ones(size)
    no_mirror[-1] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = (u * no_mirror) @ vt
    return Alignment(rotation, true_middle - rotation @ middle)


@dataclass(frozen=True, eq=False)
class TrajectoryError:
    """Distances between two trajectories after alignment, metres."""

    mean: float
    rmse: float
    """Root of the mean square: what most tools call the absolute trajectory error."""
    median: float
    max: float
    alignment: Alignment
    """true_from_estimated, in three dimensions whatever the kind of alignment."""

    def __str__(self) -> str:
        """Show all on one line."""
        return (
            f"mean {self.mean:.4f} m, rmse {self.rmse:.4f} m, "
            f"median {self.median:.4f} m, max {self.max:.4f} m"
        )


def absolute_trajectory_error(
    positions: Floats,
    true_positions: Floats,
    *,
    align: Literal["none", "se2", "se3"] = "se3",
) -> TrajectoryError:
    """Compare positions with true ones, shape (n, 3) [m], row by row.

    Parameters
    ----------
    align
        "se3" and "se2" remove the best rigid motion first ("se2": about and across the z axis
        only), "none" removes nothing.
    """
    positions, true_positions = _same_shape(positions, true_positions)
    if positions.shape[1] != 3:
        raise ValueError(f"positions: expected shape (n, 3), got {positions.shape}")
    alignment = Alignment(np.eye(3), np.zeros(3))
    if align == "se3":
        alignment = align_rigid(positions, true_positions)
    elif align == "se2":
        on_plane = align_rigid(positions[:, :2], true_positions[:, :2])
        alignment.rotation[:2, :2] = on_plane.rotation
        alignment.translation[:2] = on_plane.translation
    elif align != "none":
        raise ValueError(f'align: expected "none", "se2" or "se3", got {align!r}')
    distance = np.linalg.norm(alignment.apply(positions) - true_positions, axis=1)
    return TrajectoryError(
        mean=float(distance.mean()),
        rmse=float(np.sqrt(np.mean(distance**2))),
        median=float(np.median(distance)),
        max=float(distance.max()),
        alignment=alignment,
    )


def center_errors(centers: Floats, true_centers: Floats, alignment: Alignment) -> Floats:
    """Return the distance [m] of each object's centre from the true one after an alignment.

    Both of shape (o, 3), row by row; the alignment usually comes from the trajectory. Shape (o,).
    """
    centers, true_centers = _same_shape(centers, true_centers)
    return np.asarray(np.linalg.norm(alignment.apply(centers) - true_centers, axis=1))


def _same_shape(points: Floats, true_points: Floats) -> tuple[Floats, Floats]:
    points = as_floats("estimated points", points, [None, None])
    true_points = as_floats("true points", true_points, [None, None])
    if points.shape != true_points.shape:
        raise ValueError(
            f"estimated and true points differ in shape: {points.shape}, {true_points.shape}"
        )
    if not len(points):
        raise ValueError("there are no points to compare")
    return points, true_points


def true_rows(object_ids: Ints, truth: Truth) -> Ints:
    """Return the row in the truth of each mapped object."""
    row_of = {int(object_id): row for row, object_id in enumerate(truth.object_id)}
    unknown = [int(object_id) for object_id in object_ids if int(object_id) not in row_of]
    if unknown:
        raise ValueError(f"object {unknown[0]} of the estimate is not in the truth")
    return np.array([row_of[int(object_id)] for object_id in object_ids], dtype=np.int64)
