"""The camera that takes the images of a scenario, and the one that an estimator is given."""

import numpy as np

from dqslam import _core
from dqslam._core import Camera, PoseModel
from dqslam.simulation.scenario import CalibrationErrorSettings, CameraSettings

# Axes of a level camera (x right, y down, z forward) on a mount (x forward, y left, z up).
_MOUNT_FROM_CAMERA = [0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]


def true_camera(settings: CameraSettings) -> Camera:
    """Make the core's camera; its principal point is the middle of the image."""
    return given_camera(settings, CalibrationErrorSettings())


def given_camera(settings: CameraSettings, error: CalibrationErrorSettings) -> Camera:
    """Make the camera with a wrong calibration."""
    yaw = np.deg2rad(settings.heading_deg + error.mount_yaw_deg) / 2.0
    turn = [0.0, 0.0, np.sin(yaw), np.cos(yaw)]
    robot_from_mount = np.array([[*settings.position_in_robot_m, *turn]])
    if error.mount_pitch_deg != 0.0:
        down = np.deg2rad(error.mount_pitch_deg) / 2.0
        tilt = [[0.0, 0.0, 0.0, 0.0, np.sin(down), 0.0, np.cos(down)]]
        robot_from_mount = _core.compose(PoseModel.SE3, robot_from_mount, tilt)
    robot_from_camera = _core.compose(PoseModel.SE3, robot_from_mount, [_MOUNT_FROM_CAMERA])[0]
    focal_px = 1000.0 * settings.focal_length_mm / settings.pixel_size_um
    focal_px *= error.focal_length_factor
    return Camera(
        focal_px,
        focal_px,
        (settings.width_px - 1) / 2.0,
        (settings.height_px - 1) / 2.0,
        settings.width_px,
        settings.height_px,
        robot_from_camera=robot_from_camera,
    )
