"""Estimates as files: ``trajectory.txt``, ``odometry.txt`` (TUM), ``map.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.estimate import Estimate
from dqslam.io.files import write_json
from dqslam.io.trajectory import write_trajectory


def save_estimate(estimate: Estimate, directory: str | Path) -> None:
    """Write an estimate into a directory, which is made if need be.

    ``trajectory.txt`` has the estimated and ``odometry.txt`` the initial poses, world_from_camera;
    ``map.json`` has the objects, and why others were dropped. Each file is complete or absent.
    """
    directory = Path(directory)
    paths = {"trajectory.txt": estimate.poses, "odometry.txt": estimate.initial_poses}
    for name, poses in paths.items():
        cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, poses)
        write_trajectory(directory / name, estimate.timestamps, cameras)
    objects = [_object(estimate, row) for row in range(len(estimate.object_ids))]
    dropped = [{"id": number, "reason": reason} for number, reason in estimate.dropped.items()]
    write_json(directory / "map.json", {"objects": objects, "dropped": dropped})


def _object(estimate: Estimate, row: int) -> dict[str, Any]:
    """Describe one object; a dual quadric that is no ellipsoid has a centre, but null axes."""
    semi_axes, orientation = None, None
    if estimate.is_ellipsoid[row]:
        _, semi_axes, orientation = _core.axes_from_ellipsoid(estimate.ellipsoids[row])
    return {
        "id": int(estimate.object_ids[row]),
        "class_name": estimate.class_names[row],
        "center": estimate.centers[row],
        "semi_axes": semi_axes,
        "orientation_xyzw": orientation,
        "dual_quadric": _core.dual_quadric_matrix(estimate.dual_quadrics[row]),
        "observations": int(estimate.observations[row]),
    }
