"""The logic of the ROS node, fed with messages of a drive; rclpy is not needed."""

import numpy as np
import pytest

import dqslam as dq
from orbit import NAMES, make_orbit
from ros_messages import (
    PACKAGE,
    ROOT,
    camera_info,
    detections,
    drifting,
    odometry,
    ready,
    robot_path,
)

from dqslam_ros.poses import PoseBuffer, covariance_in_map, matrix_of, pose_of  # isort: skip
from dqslam_ros.session import Session  # isort: skip


@pytest.fixture(scope="module")
def orbit():
    return make_orbit(count=80, noise_px=0.5)


@pytest.mark.parametrize("older", [False, True])
def test_the_correction_brings_the_odometry_to_the_truth(orbit, older):
    session, drift, true = ready(), drifting(orbit), robot_path(orbit)
    for pose, time in enumerate(orbit.times):
        session.take_odometry(odometry(time, drift[pose]))
        session.take_detections(detections(orbit, pose, older=older))
        assert session.step() == 1
    time, base = session.map_from_base()
    assert time == pytest.approx(orbit.times[-1], abs=1e-9)
    error = np.linalg.norm(base[:3] - true[-1][:3])
    assert error < 0.5 * np.linalg.norm(drift[-1][:3] - true[-1][:3])
    # map_from_odom times what odometry says is where the robot is in the map.
    corrected = matrix_of(session.map_from_odom()) @ matrix_of(drift[-1])
    np.testing.assert_allclose(corrected, matrix_of(base), atol=1e-9)
    assert set(session.slam.objects.class_names) == set(NAMES.values())


def test_latency_and_order_of_arrival_change_nothing(orbit, tmp_path):
    """Images wait for their odometry; two that arrive in the wrong order are taken by time."""
    true = robot_path(orbit)
    sessions = ready(), ready()
    for pose in range(12):
        sessions[0].take_odometry(odometry(orbit.times[pose], true[pose]))
        sessions[0].take_detections(detections(orbit, pose))
        sessions[0].step()
    for pose in (1, 0, 3, 2, *range(4, 12)):
        sessions[1].take_detections(detections(orbit, pose))
        assert sessions[1].step() == 0  # no odometry yet
    for pose in range(12):
        sessions[1].take_odometry(odometry(orbit.times[pose], true[pose]))
    assert sessions[1].step() == 12
    np.testing.assert_array_equal(sessions[0].slam.poses, sessions[1].slam.poses)
    sessions[1].take_detections(detections(orbit, 5))
    assert sessions[1].step() == 0
    assert (sessions[1].counts.late, sessions[1].counts.steps) == (1, 12)
    sessions[1].save(tmp_path / "map")
    assert len(dq.load_results(tmp_path / "map").timestamps) == 12


def test_an_image_whose_odometry_never_comes_is_left_out(orbit):
    session, true = ready(wait_s=0.5), robot_path(orbit)
    session.take_detections(detections(orbit, 0))
    for pose in range(4, 12):
        session.take_odometry(odometry(orbit.times[pose], true[pose]))
    assert session.step() == 0
    assert session.counts.without_odometry == 1
    session.take_detections(detections(orbit, 6))
    assert session.step() == 1


def test_odometry_between_two_messages():
    """Half way: half of the motion, and half of the turn."""
    buffer = PoseBuffer(keep_s=10.0)
    half = np.sqrt(0.5)
    buffer.add(2.0, [2, 0, 0, 0, 0, half, half])
    buffer.add(1.0, [0, 0, 0, 0, 0, 0, 1])  # late
    found = pose_of(buffer.at(1.5))
    np.testing.assert_allclose(found[:3], [1, 0, 0], atol=1e-12)
    angle = 2 * np.degrees(np.arctan2(found[5], found[6]))
    assert angle == pytest.approx(45.0)
    assert buffer.at(0.9) is None and buffer.at(2.1) is None
    buffer.add(20.0, [0, 0, 0, 0, 0, 0, 1])
    assert buffer.at(1.5) is None  # forgotten


def test_nothing_happens_before_camera_and_mount_are_known(orbit):
    session = Session()
    session.take_detections(detections(orbit, 0))
    assert session.step() == 0
    assert session.map_from_odom() is None
    with pytest.raises(ValueError, match="there is nothing to save yet"):
        session.save("anywhere")
    with pytest.raises(ValueError, match="no map to be located in"):
        session.relocalize()
    unknown = camera_info()
    object.__setattr__(unknown, "distortion_model", "of my own")
    with pytest.raises(ValueError, match="camera_info: .*of my own"):
        session.take_camera_info(unknown)


def test_the_package_is_of_this_version():
    import re
    import sys
    import xml.etree.ElementTree as ElementTree

    cmake = (ROOT / "CMakeLists.txt").read_text()
    (version,) = re.findall(r"project\(\s*dqslam\s+VERSION\s+([\d.]+)", cmake)
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert package.find("version").text == version
    assert f'version="{version}"' in (PACKAGE / "setup.py").read_text()
    needed = {one.text for one in package.findall("exec_depend")}
    source = (PACKAGE / "dqslam_ros" / "node.py").read_text()
    used = set(re.findall(r"^from (\w+)(?:\.\w+)? import", source, flags=re.MULTILINE))
    ours = {*sys.stdlib_module_names, "dqslam", "dqslam_ros", "rclpy"}
    assert used - ours <= needed


def test_the_covariance_is_about_the_axes_of_the_map():
    """A small turn of the camera about its own x axis, beside the robot, in a map turned by 90°."""
    half = np.sqrt(0.5)
    map_from_base = matrix_of([5, 5, 0, 0, 0, half, half])  # x of the robot is y of the map
    base_from_camera = matrix_of([0, 2, 0, 0, 0, 0, 1])
    of_camera = np.diag([0, 0, 0, 0.01, 0, 0])
    found = covariance_in_map(of_camera, map_from_base, base_from_camera)
    # The robot, 2 m beside that axis, moves by 2 m a radian along z, and turns about y of the map.
    expected = np.zeros((6, 6))
    expected[2, 2], expected[4, 4] = 4 * 0.01, 0.01
    expected[2, 4] = expected[4, 2] = -2 * 0.01
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_pose_has_a_covariance(orbit):
    session, true = ready(), robot_path(orbit)
    assert session.covariance_in_map() is None
    for pose in range(30):
        session.take_odometry(odometry(orbit.times[pose], true[pose]))
        session.take_detections(detections(orbit, pose))
        session.step()
    found = session.covariance_in_map()
    np.testing.assert_allclose(found, found.T, atol=1e-15)
    assert np.linalg.eigvalsh(found).min() > 0
