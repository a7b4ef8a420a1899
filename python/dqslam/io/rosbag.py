"""ROS bags (ROS 1 .bag, rosbag2 folders of sqlite3 or mcap, .mcap and .db3 files), without ROS.

This needs the package `rosbags`: pip install 'dqslam[rosbag]'. Message types that a bag does not
describe itself are those of ROS 2 Humble and of vision_msgs 4.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from dqslam.io.bag_limits import check_bag
from dqslam.io.files import FileError
from dqslam.io.formats import Look, Progress, no_progress, quoted

NAME = "rosbag"
LOOKS = "a .bag, .mcap or .db3 file, or a folder with metadata.yaml"
ENDINGS = (".bag", ".mcap", ".db3")

# The types of vision_msgs 4, because older bags of sqlite3 do not describe their messages.
VISION_MSGS = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": (
        "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n"
    ),
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id\n"
    ),
    "vision_msgs/msg/Detection2DArray": (
        "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n"
    ),
}


def looks_like_bag(look: Look) -> bool:
    """Return whether a path is a bag, by its ending or by the metadata of a rosbag2 folder."""
    return look.suffix in ENDINGS or (look.path / "metadata.yaml").is_file()


def messages(
    path: str | Path, kind: str, topic: str | None, progress: Progress = no_progress
) -> Iterator[tuple[str, Any]]:
    """Yield the messages of one kind (``nav_msgs/msg/Odometry``) with their places, in order.

    `progress` is called with the share of the messages that was yielded.

    Raises
    ------
    FileError
        If the bag cannot be read, or if the topic is ambiguous.
    RuntimeError
        If the package `rosbags` is missing.
    """
    with _opened(path) as bag:
        name = _topic(path, _topics(bag), kind, topic)
        connections = [connection for connection in bag.connections if connection.topic == name]
        count = sum(connection.msgcount for connection in connections)
        for number, (connection, _, data) in enumerate(bag.messages(connections), start=1):
            yield f"{name}, message {number}", bag.deserialize(data, connection.msgtype)
            progress(number / count)


def kind_of_topic(path: str | Path, kinds: Sequence[str], topic: str | None) -> str | None:
    """Return the kind of message of a topic, or else the first of ``kinds`` that a bag has."""
    topics = bag_topics(path)
    if topic is not None:
        return topics.get(topic)
    return next((kind for kind in kinds if kind in topics.values()), None)


def bag_topics(path: str | Path) -> dict[str, str]:
    """Return the kind of message of each topic of a bag."""
    with _opened(path) as bag:
        return dict(_topics(bag))


@contextlib.contextmanager
def _opened(path: str | Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader
    except ImportError:
        raise RuntimeError(
            f"{path}: bags are read with rosbags, which is missing: pip install 'dqslam[rosbag]'"
        ) from None
    if not Path(path).exists():
        raise FileError(path, "no such file")
    if Path(path).name.lower().endswith(".gz"):
        raise FileError(path, "is a packed bag: unpack it first (of packed files, texts are read)")
    check_bag(path)
    try:
        with AnyReader([Path(path)], default_typestore=_typestore()) as bag:
            yield bag
    except FileError:
        raise
    except Exception as error:
        # A broken bag can fail in rosbags, in sqlite or in a codec, and each has its own errors.
        raise FileError(path, f"is no bag that can be read: {quoted(error)}") from error


def _topics(bag: Any) -> list[tuple[str, str]]:
    return [(connection.topic, connection.msgtype) for connection in bag.connections]


def check_topic(format_name: str, topic: str | None) -> None:
    """Refuse a topic of anything but a bag."""
    if topic is not None and format_name != NAME:
        raise ValueError(f"topic {topic}: only bags have topics, not {format_name}")


def stamp_seconds(message: Any) -> float:
    """Return the time of a message's header in seconds."""
    return seconds_of(message.header)


def seconds_of(header: Any) -> float:
    """Return the time of a header in seconds."""
    stamp = header.stamp
    nanoseconds: int = stamp.sec * 10**9 + stamp.nanosec
    return nanoseconds / 10**9


def _typestore() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in VISION_MSGS.items():
        store.register(get_types_from_msg(text, name))
    return store


def _topic(path: str | Path, topics: list[tuple[str, str]], kind: str, wanted: str | None) -> str:
    of_kind = sorted({name for name, message in topics if message == kind})
    if wanted is not None:
        if wanted in of_kind:
            return wanted
        raise FileError(path, f"no topic {wanted} of {kind} (it has: {_listed(topics)})")
    if not of_kind:
        raise FileError(path, f"no topic of {kind} (it has: {_listed(topics)})")
    if len(of_kind) > 1:
        raise FileError(path, f"{kind} has topics {', '.join(of_kind)}: name one with --topic")
    return of_kind[0]


def _listed(topics: list[tuple[str, str]]) -> str:
    return ", ".join(sorted({f"{name} ({message})" for name, message in topics})) or "nothing"
