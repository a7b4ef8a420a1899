"""Make the bags of the corpus: `PYTHONPATH=tests:tests/python ./run python -m fuzz.bags`."""

import tempfile
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin

from fuzz.readers import SEEDS
from test_io_rosbag import Bag
from test_io_rosbag_frames import stamped, tf, transform

START = 1.7e9
PATH = [(START, (0, 0, 0)), (START + 0.1, (0.1, 0, 0)), (START + 0.3, (0.2, 0, 0.1))]
LEVEL = (0, 0, 0, 1)


def camera(bag: Bag) -> Any:
    name, message = bag.camera()
    message.k[:] = [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]
    message.d[:] = 0
    return name, message


def boxes(bag: Bag) -> list[Any]:
    cup = (25.0, 40.0, 30.0, 40.0, (("cup", 0.9),), "1")
    bottle = (150.0, 110.0, 100.0, 120.0, (("bottle", 0.8),), "2")
    moved = (27.0, 40.0, 30.0, 40.0, (("cup", 0.7),), "1")
    return [bag.boxes(START, cup, bottle), bag.boxes(START + 0.1, moved)]


def path(bag: Bag) -> Any:
    name = "nav_msgs/msg/Path"
    return name, bag.make(name, bag.header(START), [stamped(bag, *row)[1] for row in PATH])


def main() -> None:
    bag = Bag()
    odometry = [bag.odometry(time, p, LEVEL) for time, p in PATH]
    moving = [tf(bag, transform(bag, time, "odom", "base_link", p)) for time, p in PATH]
    mount = tf(bag, transform(bag, 0, "base_link", "camera", (0, 0, 0)))
    bags = {
        "camera/rosbag/info": {"/camera_info": [camera(bag)]},
        "detections/rosbag/boxes": {"/boxes": boxes(bag)},
        "trajectory/rosbag/odometry": {"/odom": odometry, "/camera_info": [camera(bag)]},
        "trajectory/rosbag/poses": {"/pose": [stamped(bag, *row) for row in PATH]},
        "trajectory/rosbag/path": {"/path": [path(bag)]},
        "trajectory/rosbag/tf": {"/tf": moving, "/tf_static": [mount], "/info": [camera(bag)]},
    }
    for name, topics in bags.items():
        out = SEEDS / f"{name}.mcap"
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            made = bag.write(Path(folder) / "bag", topics, StoragePlugin.MCAP)
            (file,) = made.glob("*.mcap")
            out.write_bytes(file.read_bytes())


if __name__ == "__main__":
    main()
