"""Draws frames.svg, the conventions of the world, the robot, the camera and the image.

Run by hand after a change: ``./run python docs/figures/frames.py``.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Polygon, Rectangle

AXES = {"x": "#D55E00", "y": "#009E73", "z": "#0072B2"}
INK, PALE = "#333333", "#e8edf2"
# Columns: where one meter along x, y and z of the world goes on paper.
PROJECTION = np.array([[0.85, 0.5, 0.0], [-0.3, 0.42, 1.0]])
YAW = np.radians(20.0)  # of the robot
WORLD_FROM_ROBOT = np.array(
    [[np.cos(YAW), -np.sin(YAW), 0.0], [np.sin(YAW), np.cos(YAW), 0.0], [0.0, 0.0, 1.0]]
)
ROBOT_IN_WORLD = np.array([2.9, 0.2, 0.0])
# x right, y down, z forward on a robot with x forward, y left, z up; mounted 2 m high.
ROBOT_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
CAMERA_IN_ROBOT = np.array([0.55, 0.0, 2.0])


def flat(points):
    """Project points of the world, shape (..., 3), onto the paper."""
    return np.asarray(points) @ PROJECTION.T


def arrow(axes, start, end, color, **style):
    """Draw an arrow between two points on the paper."""
    axes.add_patch(
        FancyArrowPatch(
            start,
            end,
            arrowstyle="-|>",
            mutation_scale=11,
            color=color,
            shrinkA=0,
            shrinkB=0,
            **style,
        )
    )


def draw_frame(axes, origin, rotation, length, names, gaps):
    """Draw three axes, each with its name beside the tip."""
    for column, (axis, color) in enumerate(AXES.items()):
        tip = origin + length * rotation[:, column]
        arrow(axes, flat(origin), flat(tip), color, linewidth=2)
        place = flat(tip) + gaps[column]
        axes.text(*place, f"{axis} {names[column]}".strip(), color=color, fontsize=10, va="center")


def draw_world(axes):
    """Draw the ground, the robot on it and its camera."""
    ground = flat([[-0.5, -1.2, 0], [4.6, -1.2, 0], [4.6, 2.2, 0], [-0.5, 2.2, 0]])
    axes.add_patch(Polygon(ground, facecolor=PALE, edgecolor="none"))
    gaps = [(0.08, -0.05), (0.06, 0.06), (0.08, 0.0)]
    draw_frame(axes, np.zeros(3), np.eye(3), 1.0, ["", "", "up"], gaps)
    axes.text(-0.85, -0.02, "world", fontsize=11, weight="bold")

    def on_robot(points):
        return ROBOT_IN_WORLD + np.asarray(points) @ WORLD_FROM_ROBOT.T

    base = np.array([[-0.55, -0.4, 0], [0.75, -0.4, 0], [0.75, 0.4, 0], [-0.55, 0.4, 0]])
    low, high = (flat(on_robot(base + [0, 0, height])) for height in (0.0, 0.3))
    for side in ([low[0], low[1], high[1], high[0]], [low[1], low[2], high[2], high[1]], high):
        axes.add_patch(Polygon(side, facecolor="#c9d3dc", edgecolor=INK, linewidth=0.8))
    mast = flat(on_robot([[*CAMERA_IN_ROBOT[:2], 0.3], CAMERA_IN_ROBOT]))
    axes.plot(*mast.T, color="#9aa5af", linewidth=5, zorder=0.5)
    gaps = [(0.08, -0.02), (-0.02, 0.13), (-0.2, 0.13)]
    robot = on_robot([0, 0, 0.3])
    draw_frame(axes, robot, WORLD_FROM_ROBOT, 0.8, ["forward", "left", "up"], gaps)
    axes.text(*(low[0] + (-0.1, -0.28)), "robot", fontsize=11, weight="bold")

    camera = on_robot(CAMERA_IN_ROBOT)
    world_from_camera = WORLD_FROM_ROBOT @ ROBOT_FROM_CAMERA
    gaps = [(-0.3, -0.14), (0.08, 0.05), (0.06, 0.08)]
    draw_frame(axes, camera, world_from_camera, 0.75, ["right", "down", "forward"], gaps)
    axes.text(*(flat(camera) + (-0.3, 0.18)), "camera", fontsize=11, weight="bold")

    style = {"linewidth": 1.2, "linestyle": "--", "connectionstyle": "arc3,rad=0.25"}
    arrow(axes, flat([0, 0, 0]), flat(robot), INK, **style)
    axes.text(0.55, -1.22, "world_from_robot", fontsize=9, family="monospace")
    arrow(axes, flat(robot), flat(camera), INK, **(style | {"connectionstyle": "arc3,rad=-0.55"}))
    axes.text(1.05, 1.35, "robot_from_camera", fontsize=9, family="monospace")
    axes.set(xlim=(-1.05, 5.1), ylim=(-2.1, 2.2), aspect="equal")
    axes.set_axis_off()


def draw_image(axes):
    """Draw the pixels of a small image, a box and its four numbers."""
    width, height = 8, 6
    for column in range(width):
        for row in range(height):
            axes.add_patch(
                Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor="white", edgecolor="#c3ccd4")
            )
            axes.plot(column, row, ".", color="#9aa5af", markersize=3)
    axes.add_patch(
        Rectangle((-0.5, -0.5), width, height, facecolor="none", edgecolor=INK, linewidth=1.5)
    )
    box = (1.7, 1.3, 5.6, 4.2)
    axes.add_patch(
        Rectangle(
            box[:2],
            box[2] - box[0],
            box[3] - box[1],
            facecolor="#D55E0022",
            edgecolor="#D55E00",
            linewidth=2,
        )
    )
    axes.text(box[0] + 0.15, box[1] + 0.5, "(u_min, v_min)", fontsize=9)
    axes.text(box[2] - 0.15, box[3] - 0.3, "(u_max, v_max)", fontsize=9, ha="right")
    axes.plot(0, 0, "o", color="#0072B2", markersize=6)
    axes.annotate(
        "center of the first pixel: (0, 0)",
        (0, 0),
        (1.6, -1.15),
        fontsize=9,
        color="#0072B2",
        arrowprops={"arrowstyle": "-", "color": "#0072B2", "shrinkB": 4},
    )
    axes.annotate(
        "corner of the image: (-0.5, -0.5)",
        (-0.5, -0.5),
        (-0.3, -1.9),
        fontsize=9,
        arrowprops={"arrowstyle": "-", "color": INK, "shrinkB": 1},
    )
    arrow(axes, (-0.5, 6.2), (2.0, 6.2), INK, linewidth=1.5)
    axes.text(2.2, 6.25, "u, right", fontsize=10, va="center")
    arrow(axes, (-1.1, -0.5), (-1.1, 2.0), INK, linewidth=1.5)
    axes.text(-1.1, 2.25, "v, down", fontsize=10, ha="center", va="top", rotation=90)
    axes.text(width - 0.5, 6.25, "(width - 0.5, height - 0.5)", fontsize=9, ha="right", va="center")
    axes.set(xlim=(-2.0, 8.2), ylim=(6.8, -2.5), aspect="equal")
    axes.set_axis_off()


def main():
    """Write frames.svg beside this file."""
    mpl.rcParams["svg.hashsalt"] = "dqslam"  # the same file each time
    figure = Figure(figsize=(10.4, 4.4), layout="constrained", facecolor="white")
    left, right = figure.subplots(1, 2, width_ratios=[1.35, 1])
    draw_world(left)
    draw_image(right)
    out = Path(__file__).with_suffix(".svg")
    figure.savefig(out, metadata={"Date": None})


main()
