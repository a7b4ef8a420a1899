"""The logic of the ROS node, fed with the message types of rosbags; rclpy is not needed."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import dqslam as dq
from orbit import CAMERA, NAMES, make_orbit

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ros" / "dqslam_ros"
sys.path.insert(0, str(PACKAGE))

from dqslam_ros.poses import PoseBuffer, matrix_of, pose_of  # noqa: E402
from dqslam_ros.session import Session, SessionOptions, boxes_of  # noqa: E402

typesys = pytest.importorskip("rosbags.typesys", reason="rosbags: pip install 'dqslam[rosbag]'")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
# The camera looks along the robot's x; it is 0.2 m before and 0.5 m above the robot's middle.
MOUNT = np.array([0.2, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5])


def types(name):
    return STORE.types[name]


def header(time, frame=""):
    stamp = types("builtin_interfaces/msg/Time")
    whole = int(time)
    at = stamp(sec=whole, nanosec=round((time - whole) * 1e9))
    return types("std_msgs/msg/Header")(stamp=at, frame_id=frame)


def camera_info():
    region = types("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)
    k = [CAMERA["fx"], 0, CAMERA["cx"], 0, CAMERA["fy"], CAMERA["cy"], 0, 0, 1]
    return types("sensor_msgs/msg/CameraInfo")(
        header=header(0, "camera"),
        height=CAMERA["height"],
        width=CAMERA["width"],
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array(k, dtype=float),
        r=np.eye(3).ravel(),
        p=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


def odometry(time, pose):
    x, y, z, qx, qy, qz, qw = map(float, pose)
    place = types("geometry_msgs/msg/Pose")(
        types("geometry_msgs/msg/Point")(x, y, z),
        types("geometry_msgs/msg/Quaternion")(qx, qy, qz, qw),
    )
    zero = types("geometry_msgs/msg/Vector3")(0.0, 0.0, 0.0)
    twist = types("geometry_msgs/msg/Twist")(zero, zero)
    return types("nav_msgs/msg/Odometry")(
        header(time, "odom"),
        "base_link",
        types("geometry_msgs/msg/PoseWithCovariance")(place, np.zeros(36)),
        types("geometry_msgs/msg/TwistWithCovariance")(twist, np.zeros(36)),
    )


def detection(box, name, *, older, score=0.9):
    """A detection of vision_msgs 4, or of an earlier version, which has other fields."""
    u, v = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    place = SimpleNamespace(x=u, y=v)
    center = SimpleNamespace(x=u, y=v, theta=0.0)
    result = SimpleNamespace(id=name, score=score)
    if not older:
        center = SimpleNamespace(position=place, theta=0.0)
        result = SimpleNamespace(hypothesis=SimpleNamespace(class_id=name, score=score))
    bbox = SimpleNamespace(center=center, size_x=box[2] - box[0], size_y=box[3] - box[1])
    return SimpleNamespace(bbox=bbox, results=[result], id="", tracking_id="")


def detections(orbit, pose, *, older=False):
    found = [
        detection(box, NAMES[name], older=older)
        for (at, name), box in orbit.boxes.items()
        if at == pose
    ]
    return SimpleNamespace(header=header(orbit.times[pose]), detections=found)


def robot_path(orbit):
    """Return odom_from_base of each pose: odometry begins where the camera's world has it."""
    mount = np.linalg.inv(matrix_of(MOUNT))
    return [pose_of(matrix_of(pose) @ mount) for pose in orbit.poses]


def drifting(orbit, seed=0):
    """Return odometry whose steps have noise of 4 mm and 4 mrad."""
    random = np.random.default_rng(seed)
    true = [matrix_of(pose) for pose in robot_path(orbit)]
    path = [true[0]]
    for before, after in zip(true[:-1], true[1:], strict=True):
        noise = np.concatenate([random.normal(0, 0.004, 3), random.normal(0, 0.002, 3), [1.0]])
        noise[3:] /= np.linalg.norm(noise[3:])
        path.append(path[-1] @ np.linalg.inv(before) @ after @ matrix_of(noise))
    return [pose_of(one) for one in path]


@pytest.fixture(scope="module")
def orbit():
    return make_orbit(count=80, noise_px=0.5)


def ready(**options):
    session = Session(SessionOptions(**options))
    session.take_camera_info(camera_info())
    session.set_mount(MOUNT)
    return session


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


def test_boxes_of_a_message():
    camera = dq.Camera(500, 510, 321, 239, 640, 480)
    message = SimpleNamespace(
        detections=[
            detection([10, 20, 110, 220], "cup", older=False),
            detection([-0.5, 20, 60, 220], "cut", older=False),
            detection([10, 20, 110, 220], "weak", older=False, score=0.2),
        ]
    )
    boxes = boxes_of(message, camera, SessionOptions())
    np.testing.assert_allclose(boxes.box, [[10, 20, 110, 220], [-0.5, 20, 60, 220]])
    assert list(boxes.class_name) == ["cup", "cut"]
    np.testing.assert_array_equal(boxes.truncated, [[0, 0, 0, 0], [1, 0, 0, 0]])
    np.testing.assert_array_equal(boxes.object_id, [-1, -1])


def test_nothing_happens_before_camera_and_mount_are_known(orbit):
    session = Session()
    session.take_detections(detections(orbit, 0))
    assert session.step() == 0
    assert session.map_from_odom() is None
    with pytest.raises(ValueError, match="there is nothing to save yet"):
        session.save("anywhere")
    fisheye = camera_info()
    object.__setattr__(fisheye, "distortion_model", "equidistant")
    with pytest.raises(ValueError, match="no lens model 'equidistant' here yet"):
        session.take_camera_info(fisheye)


def test_the_package_is_of_this_version():
    import re
    import xml.etree.ElementTree as ElementTree

    cmake = (ROOT / "CMakeLists.txt").read_text()
    (version,) = re.findall(r"project\(\s*dqslam\s+VERSION\s+([\d.]+)", cmake)
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert package.find("version").text == version
    assert f'version="{version}"' in (PACKAGE / "setup.py").read_text()
    needed = {one.text for one in package.findall("exec_depend")}
    source = (PACKAGE / "dqslam_ros" / "node.py").read_text()
    used = set(re.findall(r"^from (\w+)(?:\.\w+)? import", source, flags=re.MULTILINE))
    ours = {"__future__", "dqslam", "dqslam_ros", "scipy", "rclpy"}
    assert used - ours <= needed
