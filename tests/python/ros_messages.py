"""Messages of a small recording, as ROS has them, of the types of rosbags; rclpy is not needed."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orbit import CAMERA, NAMES

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "ros" / "dqslam_ros"
sys.path.insert(0, str(PACKAGE))

from dqslam_ros.poses import matrix_of, pose_of  # noqa: E402
from dqslam_ros.session import Session, SessionOptions  # noqa: E402

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


def camera_info(model="plumb_bob", d=(0.0,) * 5):
    region = types("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)
    k = [CAMERA["fx"], 0, CAMERA["cx"], 0, CAMERA["fy"], CAMERA["cy"], 0, 0, 1]
    return types("sensor_msgs/msg/CameraInfo")(
        header=header(0, "camera"),
        height=CAMERA["height"],
        width=CAMERA["width"],
        distortion_model=model,
        d=np.array(d),
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


def ready(**options):
    """A session that knows camera and mount."""
    session = Session(SessionOptions(**options))
    session.take_camera_info(camera_info())
    session.set_mount(MOUNT)
    return session
