"""Starts the node: ros2 launch dqslam_ros dqslam.launch.py detections:=/detector/boxes."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

TOPICS = {"camera_info": "/camera/camera_info", "odom": "/odom", "detections": "/detections"}


def generate_launch_description() -> LaunchDescription:
    """Return the node, with an argument for each topic."""
    arguments = [DeclareLaunchArgument(name, default_value=at) for name, at in TOPICS.items()]
    remappings = [(name, LaunchConfiguration(name)) for name in TOPICS]
    node = Node(
        package="dqslam_ros", executable="node", name="dqslam", output="screen",
        remappings=remappings,
    )  # fmt: skip
    return LaunchDescription([*arguments, node])
