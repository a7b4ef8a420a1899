"""Maps of sessions as files: what ``save_estimate`` writes, read back with its uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats
from dqslam.io import FileError, load_results, save_estimate

if TYPE_CHECKING:
    from dqslam.online.slam import OnlineSlam

# Where a result says nothing of its uncertainty: sigma of the center [m] and of the log axes.
_CENTER_SIGMA_M, _LOG_SIGMA = 0.05, 0.1


@dataclass(frozen=True, eq=False)
class KnownMap:
    """Objects that a session begins with."""

    camera: _core.Camera
    ids: list[int]
    class_names: tuple[str, ...]
    ellipsoids: Floats
    """Shape (o, 9)."""
    covariances: Floats
    """Of these, shape (o, 9, 9)."""

    def rows(self) -> Iterator[tuple[int, str, Floats, Floats]]:
        """Go through id, class, ellipsoid and covariance of each object."""
        yield from zip(self.ids, self.class_names, self.ellipsoids, self.covariances, strict=True)


@dataclass(frozen=True, eq=False)
class _Covariances:
    poses: Floats
    objects: Floats


def load_map(directory: str | Path) -> KnownMap:
    """Read the objects of a result that are ellipsoids, and how uncertain they are.

    A result has the covariance of the center and the sigmas of the log semi-axes; the orientation
    is taken to be known as well as the axes differ.
    """
    results = load_results(directory)
    objects = results.objects
    rows = np.flatnonzero(objects.is_ellipsoid)
    if not rows.size:
        raise FileError(Path(directory) / "map.json", "has no ellipsoid to find the way by")
    covariances = []
    for row in rows:
        center = objects.center_covariance[row]
        sigma = objects.log_semi_axes_sigma[row]
        covariance = np.zeros((9, 9))
        known = np.isfinite(center).all()
        covariance[:3, :3] = center if known else _CENTER_SIGMA_M**2 * np.eye(3)
        log_sigma = sigma if np.isfinite(sigma).all() else np.full(3, _LOG_SIGMA)
        covariance[3:, 3:] = _shape_covariance(
            objects.semi_axes[row], objects.orientation_xyzw[row], log_sigma
        )
        covariances.append(covariance)
    return KnownMap(
        camera=results.camera,
        ids=objects.id[rows].tolist(),
        class_names=tuple(objects.class_name[row] for row in rows),
        ellipsoids=objects.ellipsoids[rows],
        covariances=np.array(covariances),
    )


def _shape_covariance(semi_axes: Floats, orientation_xyzw: Floats, log_sigma: Floats) -> Floats:
    """Return the covariance of the log-Cholesky shape, (6, 6).

    Of six independent changes, the logarithms of the axes and the angles between them: turning by
    an angle a in the plane of axes i and j changes log S by (log s_i - log s_j) a. Angles have the
    sigma at which that equals the larger of the two log sigmas, at most half a radian.
    """
    logs = np.log(semi_axes)
    apart = np.abs(np.roll(logs, -1) - np.roll(logs, -2)) + 1e-3
    wider = np.maximum(np.roll(log_sigma, -1), np.roll(log_sigma, -2))
    sigma = np.concatenate([log_sigma, np.minimum(wider / apart, 0.5)])
    spread = _core.shape_from_axes_jacobian(semi_axes, orientation_xyzw) * sigma
    return np.asarray(spread @ spread.T + 1e-10 * np.eye(6))


def with_mount(camera: _core.Camera, robot_from_camera: ArrayLike | None) -> _core.Camera:
    """Return a camera where it is on the robot; by default, robot and camera are the same."""
    if robot_from_camera is None:
        return camera
    return _core.Camera(
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        camera.width,
        camera.height,
        distortion=camera.distortion,
        robot_from_camera=np.asarray(robot_from_camera, dtype=np.float64),
    )


def object_covariances(
    session: _core.Session, options: _core.SolveOptions, *, skip: set[int]
) -> dict[int, Floats]:
    """Return the covariance (9, 9) of each object that the session has boxes of, by row.

    Objects of a loaded map are left out: the problem does not have their priors.
    """
    if session.num_poses < 1:
        return {}
    graph, rows = session.to_graph()
    if not rows or skip:
        return {}
    state = _core.State(session.poses, session.ellipsoids[rows])
    objects = _core.covariance(graph, options, state).objects.reshape(-1, 9, 9)
    known = [bool(np.isfinite(one).all()) for one in objects]
    return {
        row: one
        for row, one, good in zip(rows, objects, known, strict=True)
        if good and row not in skip
    }


def save_session(
    slam: OnlineSlam, covariances: Mapping[int, Floats], directory: str | Path
) -> None:
    """Write the estimate with the covariances of its objects, by id."""
    estimate = slam.estimate()
    unknown = np.full((9, 9), np.nan)
    objects = np.array(
        [covariances.get(number, unknown) for number in estimate.object_ids.tolist()]
    )
    k = 3 if slam.pose_model == _core.PoseModel.SE2 else 6
    poses = np.full((len(estimate.poses), k, k), np.nan)
    save_estimate(estimate, directory, marginals=_Covariances(poses, objects.reshape(-1, 9, 9)))
