"""Installs the node where ROS 2 looks for it."""

from setuptools import setup

NAME = "dqslam_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/dqslam.launch.py"]),
        (f"share/{NAME}/rviz", ["rviz/dqslam.rviz"]),
    ],
    install_requires=["setuptools", "dqslam"],
    license="BSD-3-Clause",
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
