"""Errors of an estimate against the truth of a simulation, by object id and without alignment."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints, require
from dqslam._core import PoseModel
from dqslam.estimate import Estimate
from dqslam.metrics.alignment import same_shape
from dqslam.recording import Truth


@dataclass(frozen=True)
class Report:
    """Errors of an estimate, as the paper defines them ([S&M17] section 5.2).

    The paper calls its first two metrics RMSE; they are mean distances, without alignment.
    """

    rmse_pos: float
    """Mean distance of the poses from their true places, meters."""
    odometry_rmse_pos: float
    """Mean distance of the odometry's poses from their true places, meters."""
    rmse_landmark: float
    """Mean distance of the mapped objects' centers from their true places, meters."""
    rmse_volume: float
    """Mean absolute error of the paper's volumes of the mapped objects, cubic meters."""
    mapped: int
    """Number of objects in the estimate."""
    not_ellipsoids: int
    """Number of mapped objects whose dual quadric is not an ellipsoid."""
    volume_relative_errors: tuple[float, ...] = ()
    """|error| / truth of our own estimate of volume, for each mapped ellipsoid."""

    def __str__(self) -> str:
        """Show one line per error."""
        relative = np.median(self.volume_relative_errors) if self.volume_relative_errors else np.nan
        return (
            f"position error  {self.rmse_pos:8.3f} m   (odometry {self.odometry_rmse_pos:.3f} m)\n"
            f"object centers  {self.rmse_landmark:8.3f} m   ({self.mapped} objects, "
            f"{self.not_ellipsoids} of them no ellipsoid)\n"
            f"object volumes  {self.rmse_volume:8.3f} m^3"
            f"   (our own volumes: {relative:.0%} off)"
        )


def evaluate(estimate: Estimate, truth: Truth) -> Report:
    """Compare an estimate with the truth, objects by their ids, without any alignment.

    Raises
    ------
    ValueError
        If an object of the estimate is not in the truth.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> estimate, summary = dq.solve(dq.build_graph(recording))
    >>> report = dq.evaluate(estimate, truth)
    >>> report.rmse_pos < 0.1 < 1.0 < report.odometry_rmse_pos
    True
    """
    require(estimate, Estimate, "evaluate", "estimate, summary = solve(graph)")
    require(truth, Truth, "evaluate", "recording, truth = simulate(scenario, seed=0)")
    rows = true_rows(estimate.object_ids, truth)
    paper_volumes = cube_volumes(estimate.shapes)
    paper_volumes[estimate.is_body] = estimate.volumes[estimate.is_body]
    volume_errors = np.abs(paper_volumes - truth.volumes[rows])
    real = estimate.is_ellipsoid
    volumes_of = box_volumes if truth.ellipsoids is None else ellipsoid_volumes
    volumes = np.full(len(rows), np.nan)
    volumes[real] = volumes_of(estimate.shapes[real])
    volumes[estimate.is_body] = estimate.volumes[estimate.is_body]
    relative_errors = np.abs(volumes[real] / truth.volumes[rows][real] - 1.0)
    return Report(
        rmse_pos=position_error(truth.pose_model, estimate.poses, truth.poses),
        odometry_rmse_pos=position_error(truth.pose_model, estimate.initial_poses, truth.poses),
        rmse_landmark=mean_distance(estimate.centers, truth.centers[rows]),
        rmse_volume=float(volume_errors.mean()),
        mapped=len(rows),
        not_ellipsoids=int((~real).sum()),
        volume_relative_errors=tuple(relative_errors.tolist()),
    )


def position_error(pose_model: PoseModel, poses: Floats, true_poses: Floats) -> float:
    """Return RMSE_pos: the mean distance [m] between poses, on the plane for SE(2), unaligned.

    Both have shape (n, d).
    """
    axes = 2 if pose_model == PoseModel.SE2 else 3
    return mean_distance(np.asarray(poses)[:, :axes], np.asarray(true_poses)[:, :axes])


def mean_distance(points: Floats, true_points: Floats) -> float:
    """Return the mean distance between rows of two tables of the same shape (n, k)."""
    points, true_points = same_shape(points, true_points)
    return float(np.linalg.norm(points - true_points, axis=1).mean())


def cube_volumes(shapes: Floats) -> Floats:
    """Return the paper's volume [m^3] of each quadric, from shapes S [m^2] of shape (o, 3, 3).

    It is the volume of the cube whose side is the smallest full axis, 2 sqrt(smallest eigenvalue of
    S). A quadric that is no ellipsoid has negative eigenvalues and no such axis. The paper has no
    rule for this case; here the absolute value of the eigenvalue is used.
    """
    smallest = np.linalg.eigvalsh(shapes)[:, 0]
    return np.asarray((2.0 * np.sqrt(np.abs(smallest))) ** 3)


def ellipsoid_volumes(shapes: Floats) -> Floats:
    """Return the volume [m^3] of each ellipsoid, from shapes S [m^2] of shape (o, 3, 3)."""
    return np.asarray(4.0 / 3.0 * np.pi * np.sqrt(np.linalg.det(shapes)))


def box_volumes(shapes: Floats) -> Floats:
    """Return the volume [m^3] of the upright box-shaped object of each ellipsoid.

    Shapes S [m^2] have shape (o, 3, 3), and the z axis of the world is up. An upright box with
    ground l x w, seen from all around, has a mean half width of (l + w) / pi. The ellipsoid with
    the same outlines has this half width too. Therefore, its horizontal semi-axes are 4 / pi times
    the half sides for l = w. Otherwise this holds approximately for the geometric means. The height
    of the ellipsoid is that of the box, 2 sqrt(S_zz).
    """
    across = np.sqrt(np.linalg.det(shapes[:, :2, :2]))  # product of the ground's semi-axes
    return np.asarray(8.0 * (np.pi / 4.0) ** 2 * across * np.sqrt(shapes[:, 2, 2]))


def true_rows(object_ids: Ints, truth: Truth) -> Ints:
    """Return the row in the truth of each mapped object, shape (o,)."""
    row_of = {int(object_id): row for row, object_id in enumerate(truth.object_ids)}
    unknown = [int(object_id) for object_id in object_ids if int(object_id) not in row_of]
    if unknown:
        raise ValueError(f"object {unknown[0]} of the estimate is not in the truth")
    return np.array([row_of[int(object_id)] for object_id in object_ids], dtype=np.int64)
