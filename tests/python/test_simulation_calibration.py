"""What an estimator is told wrongly about the camera and its clock."""

import numpy as np
import pytest

import oracle
from dqslam import _core, load_scenario, simulate
from dqslam.simulation.camera import given_camera, true_camera
from dqslam.simulation.path import move, poses_later
from dqslam.simulation.scenario import CalibrationErrorSettings

PAPER, ORBIT = load_scenario("paper"), load_scenario("orbit")


def wrong(scenario=PAPER, **values):
    return scenario.model_copy(update={"calibration": CalibrationErrorSettings(**values)})


def direction(camera, forward, left, up):
    """Pixel of a direction in the robot's frame."""
    far = 1e6 * np.array([[forward, left, up]])
    pixels, depth = oracle.to_pixels(camera, np.eye(4), far)
    assert depth[0] > 0.0
    return pixels[0]


def test_the_camera_that_is_given_is_turned_and_tilted():
    """The direction that the optical axis is said to have is seen in the middle."""
    turned = given_camera(PAPER.camera, CalibrationErrorSettings(mount_yaw_deg=2.0))
    angle = np.deg2rad(92.0)
    np.testing.assert_allclose(
        direction(turned, np.cos(angle), np.sin(angle), 0.0), [639.5, 511.5], atol=1e-2
    )
    tilted = given_camera(PAPER.camera, CalibrationErrorSettings(mount_pitch_deg=2.0))
    down = np.deg2rad(2.0)
    np.testing.assert_allclose(
        direction(tilted, 0.0, np.cos(down), -np.sin(down)), [639.5, 511.5], atol=1e-2
    )
    level = direction(tilted, 0.0, 1.0, 0.0)
    np.testing.assert_allclose(level, [639.5, 511.5 - 1500.0 * np.tan(down)], atol=1e-2)
    np.testing.assert_array_equal(turned.robot_from_camera[:3], 0.0)


def test_the_focal_length_that_is_given_is_longer():
    camera = given_camera(PAPER.camera, CalibrationErrorSettings(focal_length_factor=1.02))
    assert (camera.fx, camera.fy, camera.cx, camera.width) == (1530.0, 1530.0, 639.5, 1280)
    assert true_camera(PAPER.camera).fx == 1500.0


@pytest.mark.parametrize(
    "error", [{"mount_yaw_deg": 2.0}, {"mount_pitch_deg": 2.0}, {"focal_length_factor": 1.02}]
)
def test_images_are_taken_by_the_true_camera(error):
    right, truth = simulate(PAPER, seed=0)
    told, same = simulate(wrong(**error), seed=0)
    np.testing.assert_array_equal(right.detections.box, told.detections.box)
    np.testing.assert_array_equal(truth.poses, same.poses)
    given = np.r_[told.camera.fx, told.camera.robot_from_camera]
    assert np.abs(given - np.r_[right.camera.fx, right.camera.robot_from_camera]).max() > 1e-3


def test_late_images_show_the_world_from_later_poses():
    """A quarter of a step later: the boxes are those of ellipsoids from the poses in between."""
    detector = PAPER.detector.model_copy(update={"edge_sigma_px": 0.0})
    scenario = PAPER.model_copy(update={"detector": detector, "objects": "ellipsoids"})
    late, truth = simulate(wrong(scenario, time_offset_s=0.25), seed=0)
    motion = move(scenario.path, np.random.default_rng(0))
    np.testing.assert_array_equal(truth.poses, motion.poses)
    poses = poses_later(motion, 0.25)
    bodies = [_core.axes_from_ellipsoid(one) for one in truth.ellipsoids]
    for index in range(0, len(late.detections), 40):
        surface = oracle.ellipsoid_surface(*bodies[truth.box_object_id[index]], count=120)
        robot = oracle.se2_matrix(poses[late.detections.pose[index]])
        box = oracle.bounding_box(late.camera, robot, surface)
        np.testing.assert_allclose(late.detections.box[index], box, atol=0.1)


def test_time_stamps_and_odometry_do_not_know_that_images_are_late():
    right, _ = simulate(ORBIT, seed=0)
    late, _ = simulate(wrong(ORBIT, time_offset_s=0.1), seed=0)
    np.testing.assert_array_equal(right.timestamps, late.timestamps)
    np.testing.assert_array_equal(right.odometry.relative, late.odometry.relative)
    assert right.detections.box.shape != late.detections.box.shape or (
        np.abs(right.detections.box - late.detections.box).max() > 5.0
    )
