"""Bags are made with the writers of rosbags, which knows nothing of this package."""

import numpy as np
import pytest

from dqslam.io import FileError, read_camera, read_detections, read_trajectory
from dqslam.io.rosbag import VISION_MSGS

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'dqslam[rosbag]'")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# vision_msgs 3, as of ROS 2 Foxy and Galactic.
OLDER = {
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "string id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/BoundingBox2D": (
        "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nbool is_tracking\nstring tracking_id\n"
    ),
    "vision_msgs/msg/Detection2DArray": (
        "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n"
    ),
}
ROS_1 = OLDER | {
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\n"
    ),
}


class Bag:
    """Messages by name, so that a test says only what it is about."""

    def __init__(self, older=False):
        self.older = older
        self.store = get_typestore(Stores.ROS2_FOXY if older else Stores.ROS2_HUMBLE)
        for name, text in (OLDER if older else VISION_MSGS).items():
            self.store.register(get_types_from_msg(text, name))

    def make(self, name, *fields):
        return self.store.types[name](*fields)

    def header(self, time, frame="map"):
        seconds = int(time)
        stamp = self.make("builtin_interfaces/msg/Time", seconds, round((time - seconds) * 1e9))
        return self.make("std_msgs/msg/Header", stamp, frame)

    def pose(self, p=(0, 0, 0), q=(0, 0, 0, 1)):
        pose = self.make(
            "geometry_msgs/msg/Pose",
            self.make("geometry_msgs/msg/Point", *map(float, p)),
            self.make("geometry_msgs/msg/Quaternion", *map(float, q)),
        )
        return self.make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))

    def odometry(self, time, p, q, child="camera"):
        zero = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.make("geometry_msgs/msg/Twist", zero, zero)
        twist = self.make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36))
        name = "nav_msgs/msg/Odometry"
        return name, self.make(name, self.header(time), child, self.pose(p, q), twist)

    def boxes(self, time, *rows, theta=0.0):
        """Each row: x, y, width, height, ((class, score), ...), id."""
        detections = []
        for x, y, w, h, results, track in rows:
            name = "vision_msgs/msg/ObjectHypothesisWithPose"
            if self.older:
                hypotheses = [self.make(name, *result, self.pose()) for result in results]
                center = self.make("geometry_msgs/msg/Pose2D", x, y, theta)
                tail = (True, track)
            else:
                hypothesis = "vision_msgs/msg/ObjectHypothesis"
                hypotheses = [
                    self.make(name, self.make(hypothesis, *result), self.pose())
                    for result in results
                ]
                point = self.make("vision_msgs/msg/Point2D", x, y)
                center = self.make("vision_msgs/msg/Pose2D", point, theta)
                tail = (track,)
            bbox = self.make("vision_msgs/msg/BoundingBox2D", center, w, h)
            head = (self.header(time), hypotheses, bbox)
            detections.append(self.make("vision_msgs/msg/Detection2D", *head, *tail))
        name = "vision_msgs/msg/Detection2DArray"
        return name, self.make(name, self.header(time), detections)

    def camera(self, binning=0, region=(0, 0, 0, 0)):
        region = self.make("sensor_msgs/msg/RegionOfInterest", *region, False)
        name = "sensor_msgs/msg/CameraInfo"
        k = np.array([500.5, 0, 320.25, 0, 501, 240, 0, 0, 1])
        p = np.insert(k, [3, 6, 9], 0.0)
        distortion = np.array([0.1, -0.2, 0.003, -0.004, 0.05])
        lens = ("plumb_bob", distortion, k, np.eye(3).ravel(), p)
        header = self.header(0.5, "camera")
        return name, self.make(name, header, 480, 640, *lens, binning, binning, region)

    def write(self, path, topics, plugin=StoragePlugin.SQLITE3):
        with Writer(path, version=9, storage_plugin=plugin) as writer:
            for topic, messages in topics.items():
                name = messages[0][0]
                connection = writer.add_connection(topic, name, typestore=self.store)
                for i, (_, message) in enumerate(messages):
                    writer.write(connection, i, self.store.serialize_cdr(message, name))
        return path


ODOMETRY = [(100.25, (1, 2, 3), (0, 0, 0.6, 0.8)), (100.5, (4, 5, 6), (1, 0, 0, 0))]
CUP = (100.0, 50.0, 40.0, 20.0, (("cup", 0.3), ("jar", 0.9)), "7")
JAR = (10.0, 20.0, 4.0, 6.0, (("cup", 0.8),), "")


@pytest.fixture
def bag():
    return Bag()


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_recording_in_one_bag(tmp_path, bag, plugin):
    topics = {
        "/odom": [bag.odometry(*row) for row in ODOMETRY],
        "/boxes": [bag.boxes(100.25, CUP, JAR), bag.boxes(100.375), bag.boxes(100.5, JAR)],
        "/camera_info": [bag.camera(), bag.camera()],
    }
    path = bag.write(tmp_path / "bag", topics, plugin)
    times, poses = read_trajectory(path)
    np.testing.assert_array_equal(times, [100.25, 100.5])
    np.testing.assert_allclose(poses, [[*p, *q] for _, p, q in ODOMETRY], atol=1e-15)
    camera = read_camera(path)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (500.5, 501, 320.25, 240)
    assert (camera.width, camera.height) == (640, 480)
    np.testing.assert_array_equal(camera.distortion, [0.1, -0.2, 0.003, -0.004, 0.05])
    table = read_detections(path, width=640, height=480)
    np.testing.assert_array_equal(table.box[0], [80, 40, 120, 60])
    np.testing.assert_array_equal(table.timestamp, [100.25, 100.25, 100.5])
    assert table.frame.tolist() == [0, 0, 2]
    assert table.class_name == ("jar", "cup", "cup")
    assert table.class_id.tolist() == [1, 0, 0]
    assert table.score.tolist() == [0.9, 0.8, 0.8]
    assert table.track_id.tolist() == [7, -1, -1]


def test_a_single_mcap_file(tmp_path, bag):
    topics = {"/odom": [bag.odometry(*row) for row in ODOMETRY]}
    folder = bag.write(tmp_path / "bag", topics, StoragePlugin.MCAP)
    (file,) = folder.glob("*.mcap")
    alone = file.rename(tmp_path / "alone.mcap")
    assert len(read_trajectory(alone).timestamps) == 2


def test_older_vision_msgs(tmp_path):
    bag = Bag(older=True)
    three = (100.0, 50.0, 40.0, 20.0, (("3", 0.5),), "b")
    path = bag.write(tmp_path / "bag", {"/boxes": [bag.boxes(1.5, three, three)]})
    table = read_detections(path)
    np.testing.assert_array_equal(table.box, [[80, 40, 120, 60]] * 2)
    assert (table.class_id.tolist(), table.class_name) == ([3, 3], ("3", "3"))
    assert table.track_id.tolist() == [0, 0]


def test_one_of_several_topics_is_named(tmp_path, bag):
    first, second = (bag.odometry(*row) for row in ODOMETRY)
    path = bag.write(tmp_path / "bag", {"/a": [first], "/b": [second]})
    with pytest.raises(FileError, match=r"has topics /a, /b: name one with --topic"):
        read_trajectory(path)
    assert read_trajectory(path, topic="/b").timestamps.tolist() == [100.5]
    with pytest.raises(FileError, match=r"no topic /c of nav_msgs/msg/Odometry, .*\(it has: /a "):
        read_trajectory(path, topic="/c")


def test_what_is_wrong_is_named_with_its_message(tmp_path, bag):
    bad = bag.odometry(100.0, (1, float("nan"), 3), (0, 0, 0, 1))
    flat = (1.0, 1.0, 0.0, 1.0, (("cup", 0.5),), "")
    topics = {
        "odometry": ([bag.odometry(*ODOMETRY[0]), bad], "bag:2: ty is not a finite number below"),
        "backwards": ([bag.odometry(*row) for row in ODOMETRY[::-1]], "bag:2: time 100.25 goes ba"),
        "turned": ([bag.boxes(0, CUP, theta=0.1)], "/turned, message 1: box is turned by 0.1 rad"),
        "flat": ([bag.boxes(0, CUP), bag.boxes(1, flat)], "bag:2: empty box"),
        "empty": ([bag.boxes(0)], "holds no boxes in vision_msgs"),
    }
    for name, (messages, message) in topics.items():
        path = bag.write(tmp_path / name / "bag", {f"/{name}": messages})
        reader = read_trajectory if "odom" in name or "back" in name else read_detections
        with pytest.raises(FileError, match=message):
            reader(path)


def test_what_is_no_bag(tmp_path, bag):
    with pytest.raises(FileError, match=r"no such file"):
        read_trajectory(tmp_path / "none", "rosbag")
    (tmp_path / "bad.mcap").write_bytes(b"no bag at all")
    with pytest.raises(FileError, match=r"bad\.mcap: is no bag that can be read"):
        read_trajectory(tmp_path / "bad.mcap")
    many = {"/odom": [bag.odometry(i, (1, 2, 3), (0, 0, 0, 1)) for i in range(300)]}
    for plugin in StoragePlugin:
        path = bag.write(tmp_path / plugin.name, many, plugin)
        (file,) = (file for file in path.iterdir() if file.suffix in (".db3", ".mcap"))
        whole = file.read_bytes()
        for share in (0, 0.5, 0.99):
            file.write_bytes(whole[: int(share * len(whole))])
            with pytest.raises(FileError, match=r"is no bag that can be read"):
                read_trajectory(path)
    path = bag.write(tmp_path / "bag", {"/odom": [bag.odometry(*ODOMETRY[0])]})
    with pytest.raises(FileError, match=r"no topic of sensor_msgs/msg/CameraInfo \(it has: /odom"):
        read_camera(path)


def test_region_and_binning_of_a_camera(tmp_path, bag):
    # x_offset, y_offset, height, width
    message = bag.camera(binning=2, region=(20, 40, 400, 600))
    camera = read_camera(bag.write(tmp_path / "bag", {"/info": [message]}))
    found = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    assert found == (250.25, 250.5, 150.125, 100.0, 300, 200)


def test_a_bag_of_ros_1(tmp_path):
    """There headers count, hypotheses are numbers, and the fields of CameraInfo are capitals."""
    store = get_typestore(Stores.ROS1_NOETIC)
    for name, text in ROS_1.items():
        store.register(get_types_from_msg(text, name))
    bag = Bag()
    bag.store = store

    def header(time, frame="map"):
        stamp = bag.make("builtin_interfaces/msg/Time", int(time), round(time % 1 * 1e9))
        return bag.make("std_msgs/msg/Header", 7, stamp, frame)

    bag.header = header
    odometry, message = bag.odometry(*ODOMETRY[0])
    hypothesis = bag.make("vision_msgs/msg/ObjectHypothesisWithPose", 3, 0.5, bag.pose())
    center = bag.make("geometry_msgs/msg/Pose2D", 100.0, 50.0, 0.0)
    box = bag.make("vision_msgs/msg/BoundingBox2D", center, 40.0, 20.0)
    detection = bag.make("vision_msgs/msg/Detection2D", header(1.5), [hypothesis], box)
    arrays = "vision_msgs/msg/Detection2DArray"
    camera, info = bag.camera()
    rows = {
        "/odom": (odometry, message),
        "/boxes": (arrays, bag.make(arrays, header(1.5), [detection])),
        "/info": (camera, info),
    }
    path = tmp_path / "old.bag"
    with Writer1(path) as writer:
        for topic, (name, content) in rows.items():
            connection = writer.add_connection(topic, name, typestore=store)
            writer.write(connection, 0, store.serialize_ros1(content, name))
    times, poses = read_trajectory(path)
    assert (times.tolist(), poses[0].tolist()) == ([100.25], [1, 2, 3, 0, 0, 0.6, 0.8])
    table = read_detections(path)
    assert table.box.tolist() == [[80, 40, 120, 60]]
    assert (table.class_id.tolist(), table.track_id) == ([3], None)
    assert (read_camera(path).fx, read_camera(path).distortion[4]) == (500.5, 0.05)


def test_an_error_of_the_library_is_one_line(tmp_path, bag):
    """A definition of messages that is no definition is quoted in the error."""
    folder = bag.write(
        tmp_path / "bag", {"/odom": [bag.odometry(*ODOMETRY[0])]}, StoragePlugin.MCAP
    )
    (file,) = folder.glob("*.mcap")
    content = file.read_bytes()
    assert content.count(b"std_msgs/Header header") == 2
    file.write_bytes(content.replace(b"std_msgs/Header header", b"std_msgs/Header\nheader"))
    with pytest.raises(FileError, match="is no bag that can be read: ") as caught:
        read_trajectory(file)
    assert "\n" not in str(caught.value)
