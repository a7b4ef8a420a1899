"""Makes animation.gif: the images of a simulated session, and its growing map from above.

Run by hand after a change: ``./run python docs/figures/animation.py``.
"""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from plots import paint_image

import dqslam as dq
from dqslam import _core
from dqslam.plot.above import outline
from dqslam.plot.style import ESTIMATE, ODOMETRY, TRUTH

FILE = Path(__file__).with_suffix(".gif")
SECONDS, HZ = 12, 10
PAUSE_S = 1.5  # at the end, part of the 12 s
SIZE_INCHES, DPI = (7.6, 3.05), 100
COLORS = 128  # of the palette
RANGE_M = 1.75


def states(recording):
    """Give what a session has after each step: the path, and the objects' ellipsoids."""
    slam = dq.OnlineSlam(
        recording.camera, first_pose=dq.build_graph(recording).core.initial_poses[0]
    )
    for step in dq.steps_of(recording):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        yield slam.poses, slam.objects.ellipsoids


def draw_image(axes, recording, truth, pose, now, ellipsoids):
    """Draw the painted image of a pose, its boxes, and the outlines of the map in it."""
    camera = recording.camera
    axes.imshow(paint_image(truth, camera, pose))
    axes.set_xlim(-0.5, camera.width - 0.5)
    axes.set_ylim(camera.height - 0.5, -0.5)
    axes.set_axis_off()
    for left, top, right, bottom in recording.detections.box[recording.detections.pose == pose]:
        corners = [left, right, right, left, left], [top, top, bottom, bottom, top]
        axes.plot(*corners, color="white", linewidth=0.8, linestyle=(0, (3, 2)))
    here = np.repeat(now[None], len(ellipsoids), axis=0)
    shown = _core.project_to_outlines(_core.PoseModel.SE3, camera, here, ellipsoids)
    for curve in shown:
        axes.plot(*curve.T, color=ESTIMATE, linewidth=1.4)


def draw_map(axes, truth, drift, path, ellipsoids):
    """Draw the map from above, up to now."""
    count = len(path)
    for place, ellipsoid in zip(truth.centers, truth.ellipsoids, strict=True):
        shape = _core.ellipsoid_shapes(ellipsoid[None])[0]
        axes.fill(*outline(place[:2], shape[:2, :2]), color=TRUTH, alpha=0.35, linewidth=0)
    axes.plot(*truth.poses[:count, :2].T, color=TRUTH, linewidth=3.0, alpha=0.6)
    axes.plot(*drift[:count, :2].T, color=ODOMETRY, linewidth=1.0)
    axes.plot(*path[:, :2].T, color=ESTIMATE, linewidth=1.2)
    axes.plot(*path[-1, :2], "o", color=ESTIMATE, markersize=4)
    for center, shape in zip(ellipsoids[:, :3], _core.ellipsoid_shapes(ellipsoids), strict=True):
        axes.plot(*outline(center[:2], shape[:2, :2]), color=ESTIMATE, linewidth=1.2)
    axes.set(xlim=(-RANGE_M, RANGE_M), ylim=(-RANGE_M, RANGE_M), aspect="equal")
    axes.set_axis_off()
    names = (("odometry", ODOMETRY), ("dqslam", ESTIMATE), ("truth", TRUTH))
    for row, (name, color) in enumerate(names):
        place = (0.0, 0.93 - 0.08 * row)
        axes.text(*place, name, color=color, fontsize=9, transform=axes.transAxes)


def frame(recording, truth, drift, path, ellipsoids):
    """Return one picture."""
    figure = Figure(figsize=SIZE_INCHES, dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    pose = len(path) - 1
    left = figure.add_axes((0.0, 0.0, 0.535, 1.0))
    draw_image(left, recording, truth, pose, path[-1], ellipsoids)
    right = figure.add_axes((0.55, 0.0, 0.45, 1.0))
    draw_map(right, truth, drift, path, ellipsoids)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def main():
    """Draw as many steps, evenly spread, as the time has frames."""
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
    drift = dq.build_graph(recording).core.initial_poses
    count = round((SECONDS - PAUSE_S) * HZ)
    wanted = set(np.linspace(0, len(drift) - 1, count).round().astype(int).tolist())
    pictures = [
        frame(recording, truth, drift, path, ellipsoids)
        for pose, (path, ellipsoids) in enumerate(states(recording))
        if pose in wanted
    ]
    palette = pictures[-1].quantize(COLORS, method=Image.Quantize.FASTOCTREE)
    frames = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    durations = [round(1000 / HZ)] * (len(frames) - 1) + [round(1000 * PAUSE_S)]
    frames[0].save(
        FILE, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
