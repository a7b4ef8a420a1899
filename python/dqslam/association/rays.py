"""Boxes as rays: where their middles lie in the world, and how wide they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.recording import Recording


@dataclass(frozen=True)
class Rays:
    """The rays through the middles of boxes, one row each."""

    origin: Floats
    """Camera centers in the world, meters, shape (m, 3)."""
    direction: Floats
    """Unit vectors in the world, shape (m, 3)."""
    half_width: Floats
    """Half the side of the box, geometric mean, at a distance of 1 m along the ray, shape (m,)."""

    def select(self, rows: Ints) -> Rays:
        """Return some of the rays."""
        return Rays(self.origin[rows], self.direction[rows], self.half_width[rows])


def cast_rays(recording: Recording, cameras: Floats) -> Rays:
    """Return the ray of each box, from cameras world_from_camera (n, 7)."""
    detections = recording.detections
    return rays_of_boxes(recording.camera, cameras[detections.pose], detections.box)


def rays_of_boxes(camera: _core.Camera, seen_from: Floats, box: Floats) -> Rays:
    """Return the rays of boxes (m, 4), each from its world_from_camera, (m, 7)."""
    center = 0.5 * (box[:, :2] + box[:, 2:])
    side = box[:, 2:] - box[:, :2]
    tip = _core.compose(_core.PoseModel.SE3, seen_from, points_at_depth_one(camera, center))
    ray = tip[:, :3] - seen_from[:, :3]
    length = np.linalg.norm(ray, axis=1)
    half_width = np.sqrt(side.prod(axis=1) / (camera.fx * camera.fy)) / 2 / length
    return Rays(seen_from[:, :3], ray / length[:, None], half_width)


def cameras_by_odometry(recording: Recording) -> Floats:
    """Return world_from_camera of each pose by dead reckoning, shape (n, 7)."""
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    return _core.world_from_camera(odometry.pose_model, recording.camera, path)


def points_at_depth_one(camera: _core.Camera, pixels: Floats) -> Floats:
    """Return what pixels (m, 2) show at a depth of 1 m, as poses (m, 7) in the camera."""
    points = np.zeros((len(pixels), 7))
    points[:, 0] = (pixels[:, 0] - camera.cx) / camera.fx
    points[:, 1] = (pixels[:, 1] - camera.cy) / camera.fy
    points[:, 2] = points[:, 6] = 1.0
    return points
