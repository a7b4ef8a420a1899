"""Frames, kinds of poses, and odd messages in bags."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam.io import FileError, InputWarning, Notes, read_detections, read_trajectory

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'dqslam[rosbag]'")

from test_io_rosbag import CUP, JAR, Bag

TF = "tf2_msgs/msg/TFMessage"


@pytest.fixture
def bag():
    return Bag()


def transform(bag, time, parent, child, p, q=(0, 0, 0, 1)):
    pose = bag.make(
        "geometry_msgs/msg/Transform",
        bag.make("geometry_msgs/msg/Vector3", *map(float, p)),
        bag.make("geometry_msgs/msg/Quaternion", *map(float, q)),
    )
    name = "geometry_msgs/msg/TransformStamped"
    return bag.make(name, bag.header(time, parent), child, pose)


def tf(bag, *transforms):
    return TF, bag.make(TF, list(transforms))


def stamped(bag, time, p, kind="PoseStamped"):
    name = f"geometry_msgs/msg/{kind}"
    pose = bag.pose(p)
    return name, bag.make(name, bag.header(time), pose.pose if kind == "PoseStamped" else pose)


@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped"])
def test_poses(tmp_path, bag, kind):
    topics = {"/pose": [stamped(bag, 1.5, (1, 2, 3), kind), stamped(bag, 2.5, (4, 5, 6), kind)]}
    times, poses = read_trajectory(bag.write(tmp_path / "bag", topics))
    assert times.tolist() == [1.5, 2.5]
    np.testing.assert_array_equal(poses, [[1, 2, 3, 0, 0, 0, 1], [4, 5, 6, 0, 0, 0, 1]])


def test_the_last_path_is_the_whole_one(tmp_path, bag):
    poses = [stamped(bag, time, (time, 0, 0))[1] for time in (1, 2, 3)]
    name = "nav_msgs/msg/Path"
    paths = [(name, bag.make(name, bag.header(3), poses[:count])) for count in (1, 2, 3)]
    times, found = read_trajectory(bag.write(tmp_path / "bag", {"/path": paths}))
    assert times.tolist() == found[:, 0].tolist() == [1, 2, 3]


# The camera looks along the body's x, 0.2 m ahead of it.
OPTICAL = (-0.5, 0.5, -0.5, 0.5)


@pytest.mark.parametrize("static", [True, False])
def test_odometry_of_another_frame_than_the_camera(tmp_path, bag, static):
    topics = {
        "/odom": [bag.odometry(i, (i, 0, 0), (0, 0, 0, 1), child="base_link") for i in (0, 1)],
        "/info": [bag.camera()],
    }
    if static:
        mount = transform(bag, 0, "link", "camera", (0, 0, 0), OPTICAL)
        link = transform(bag, 0, "base_link", "link", (0.2, 0, 0))
        topics["/tf_static"] = [tf(bag, mount), tf(bag, link)]
    path = bag.write(tmp_path / "bag", topics)
    if not static:
        with pytest.warns(InputWarning, match="those of base_link, the camera is camera, and no"):
            read_trajectory(path)
    notes = Notes()
    _, poses = read_trajectory(path, notes=notes)
    assert len(notes.sentences()) == 1
    np.testing.assert_allclose(poses[:, 0], [0.2, 1.2] if static else [0, 1], atol=1e-12)
    if static:  # the camera's z is the world's x
        ahead = Rotation.from_quat(poses[:, 3:]).apply([0, 0, 1])
        np.testing.assert_allclose(ahead, [[1, 0, 0]] * 2, atol=1e-12)
    # A mount that is given goes before.
    notes = Notes()
    _, poses = read_trajectory(path, body_from_camera=[0, 7, 0, 0, 0, 0, 1], notes=notes)
    np.testing.assert_allclose(poses[:, :3], [[0, 7, 0], [1, 7, 0]], atol=1e-12)
    assert notes.sentences() == []


def test_transforms_alone(tmp_path, bag):
    """Map to odometry moves slowly, odometry to base fast, the camera stays on the base."""
    fast = [tf(bag, transform(bag, i / 2, "odom", "base_link", (i, 0, 0))) for i in range(5)]
    slow = [tf(bag, transform(bag, i, "map", "odom", (0, i, 0))) for i in range(3)]
    mount = tf(bag, transform(bag, 0, "base_link", "camera", (0, 0, 0.5), OPTICAL))
    topics = {"/tf": fast + slow, "/tf_static": [mount], "/info": [bag.camera()]}
    times, poses = read_trajectory(bag.write(tmp_path / "bag", topics))
    assert times.tolist() == [0, 0.5, 1, 1.5, 2]
    expected = [[i, i / 2, 0.5] for i in range(5)]
    np.testing.assert_allclose(poses[:, :3], expected, atol=1e-12)
    np.testing.assert_allclose(poses[:, 3:], [OPTICAL] * 5, atol=1e-12)


def test_which_transform_is_asked_for(tmp_path, bag):
    moves = [tf(bag, transform(bag, i, "map", name, (i, 0, 0))) for i in (0, 1) for name in "ab"]
    path = bag.write(tmp_path / "bag", {"/tf": moves})
    with pytest.raises(FileError, match="which transform is the camera's. it has map > a, map > b"):
        read_trajectory(path)
    path = bag.write(tmp_path / "one", {"/tf": moves[::2]})
    with pytest.warns(InputWarning, match="the poses are those of a: is it the camera"):
        assert read_trajectory(path).timestamps.tolist() == [0, 1]
    twice = [*moves[::2], tf(bag, transform(bag, 2, "odom", "a", (0, 0, 0)))]
    with pytest.raises(FileError, match="a has two parents, map and odom"):
        read_trajectory(bag.write(tmp_path / "two", {"/tf": twice}))


def test_an_array_without_a_time_has_that_of_its_detections(tmp_path, bag):
    name, first = bag.boxes(1.5, CUP, JAR)
    _, second = bag.boxes(2.5, CUP)
    for array in (first, second):
        array.header.stamp.sec, array.header.stamp.nanosec = 0, 0
    path = bag.write(tmp_path / "bag", {"/boxes": [(name, first), (name, second)]})
    assert read_detections(path, notes=Notes()).timestamp.tolist() == [1.5, 1.5, 2.5]
    first.detections[0].header.stamp.sec = 7
    path = bag.write(tmp_path / "bad", {"/boxes": [(name, first)]})
    with pytest.raises(FileError, match="message 1: no time, and its detections have 2 times"):
        read_detections(path)


def test_a_repeated_message_is_left_out_and_another_one_refused(tmp_path, bag):
    arrays = [bag.boxes(i / 2, CUP, JAR) for i in range(30)]
    notes = Notes()
    path = bag.write(tmp_path / "bag", {"/boxes": [*arrays[:4], *arrays[3:]]})
    assert len(read_detections(path, notes=notes)) == 60
    assert "1 of 31 messages left out" in notes.sentences()[0]
    path = bag.write(tmp_path / "bad", {"/boxes": [*arrays[:4], bag.boxes(1.5, JAR)]})
    with pytest.raises(FileError, match="message 5: other boxes at a time that was before, 1.5"):
        read_detections(path)


def test_detections_without_a_class(tmp_path, bag):
    bare = (100.0, 50.0, 40.0, 20.0, (), "7")
    notes = Notes()
    path = bag.write(tmp_path / "bag", {"/boxes": [bag.boxes(0, CUP, bare)]})
    assert read_detections(path, notes=notes).class_name == ("jar",)
    assert notes.left_out[0].reason == "detections without a class"
    notes = Notes()
    path = bag.write(tmp_path / "bare", {"/boxes": [bag.boxes(0, bare), bag.boxes(1, bare)]})
    table = read_detections(path, notes=notes)
    assert (table.class_name, table.score.tolist()) == (("object",) * 2, [1, 1])
    assert "no detection has a class" in notes.sentences()[0]


def test_ids_are_names(tmp_path, bag):
    rows = [(*CUP[:5], track) for track in ("12345678901234567890", "12345678901234567891")]
    path = bag.write(tmp_path / "bag", {"/boxes": [bag.boxes(0, *rows), bag.boxes(1, rows[1])]})
    assert read_detections(path, notes=Notes()).track_id.tolist() == [0, 1, 1]


def test_a_tiny_angle_is_no_turn(tmp_path, bag):
    path = bag.write(tmp_path / "bag", {"/boxes": [bag.boxes(0, CUP, theta=1e-9)]})
    np.testing.assert_array_equal(read_detections(path).box, [[80, 40, 120, 60]])
