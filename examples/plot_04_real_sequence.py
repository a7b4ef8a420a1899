"""
A real detector on a table top
==============================

The recording has sixty-three views of a table with eight small objects. Two of them were moved by
hand in between. The boxes are those of a Faster R-CNN. The recording is a part of LM-O and is not
in this repository. The variable DQSLAM_REALDATA names the folder that has it. Without that folder,
a simulated camera goes around a simulated table instead, and the output below states this.
"""

import os
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dqslam as dq
from dqslam import io
from dqslam.simulation import perturb_odometry

folder = Path(os.environ.get("DQSLAM_REALDATA", "realdata")) / "bop_lmo"
segment = folder / "seg_0703_1001"
is_real = segment.is_dir()

# %%
# The recording
# -------------
# The reference path is exact. Noise of 2 cm and 0.6 degrees a step is added to it, and the result
# serves as odometry.

if is_real:
    recording, _ = dq.load_recording(
        folder / "camera.json",
        segment / "groundtruth.txt",
        segment / "detections_fasterrcnn.csv",
        ids="none",
    )
    _, poses = io.read_trajectory(segment / "groundtruth.txt")
    true = io.read_true_objects(segment / "objects_gt.csv")
    true_centers = true.center[true.static]
    recording = perturb_odometry(recording, dq.OdometryNoise(0.02, 0.01), seed=0)
else:
    print("no real recording here (set DQSLAM_REALDATA): a simulated one takes its place")
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=0)
    without_ids = np.full(len(recording.detections), -1)
    detections = replace(recording.detections, object_id=without_ids)
    recording = replace(recording, detections=detections, positions=None)
    poses = truth.poses
    true_centers = truth.centers
print(f"{len(recording.timestamps)} views, {len(recording.detections)} boxes, no ids")

# %%
# Which boxes show the same object?
# ---------------------------------
# ``dq.run`` is the function behind ``dqslam run``. It finds this, the path and the map together.

result = dq.run(recording)
estimate = result.estimate
for object_id, name, boxes in zip(
    estimate.object_ids, estimate.class_names, estimate.observations, strict=True
):
    print(f"object {object_id}: {name}, {boxes} boxes")
print("left out:", dict(estimate.dropped) or "none")

# %%
# Against the truth
# -----------------
# Both paths are aligned with the reference by the rotation and translation that fit best.


def error_mm(path):
    """Return the root mean square distance from the reference, after alignment."""
    aligned = dq.align_rigid(path[:, :3], poses[:, :3]).apply(path[:, :3])
    return 1e3 * np.sqrt(np.mean(np.sum((aligned - poses[:, :3]) ** 2, axis=1)))


print(f"odometry {error_mm(estimate.initial_poses):.0f} mm")
print(f"estimate {error_mm(estimate.poses):.0f} mm")

to_truth = dq.align_rigid(estimate.poses[:, :3], poses[:, :3])
angle = np.linspace(0.0, 2.0 * np.pi, 73)
circle = np.stack([np.cos(angle), np.sin(angle)])
figure, axes = plt.subplots(figsize=(7, 5.5), layout="constrained")
estimated = to_truth.apply(estimate.poses[:, :3])
odometry = to_truth.apply(estimate.initial_poses[:, :3])
for path, color, name in [(odometry, "#0072B2", "odometry"), (estimated, "#D55E00", "estimate")]:
    lines_x, lines_y = np.stack([poses[:, :2], path[:, :2]]).transpose(2, 0, 1)
    axes.plot(lines_x, lines_y, color=color, linewidth=0.6)
    axes.plot(*path[:, :2].T, ".", color=color, label=f"cameras, {name}")
axes.plot(*poses[:, :2].T, "o", color="#009E73", fillstyle="none", label="cameras, truth")
axes.plot(*true_centers[:, :2].T, "s", color="#009E73", alpha=0.6, label="true object at rest")
centers = to_truth.apply(estimate.centers)
shapes = to_truth.rotation @ estimate.shapes @ to_truth.rotation.T
for name, center, shape in zip(estimate.class_names, centers, shapes, strict=True):
    outline = center[:2, None] + np.linalg.cholesky(shape[:2, :2]) @ circle
    axes.plot(*outline, color="#D55E00", linewidth=1.2)
    axes.annotate(name, center[:2], xytext=(4, 4), textcoords="offset points", fontsize=7)
axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
axes.legend(frameon=False, fontsize=8)
plt.show()

# %%
# In the image
# ------------
# The figure has the boxes of the view with the most boxes, and the boxes of the ellipsoids
# projected with the estimated pose of the camera.

shown = result.detections.select(np.isin(result.detections.object_id, estimate.object_ids))
view = np.bincount(shown.pose).argmax()
boxes = shown.select(shown.pose == view)
rows = np.searchsorted(estimate.object_ids, boxes.object_id)
predicted, _ = dq._core.project_to_boxes(
    estimate.pose_model,
    estimate.camera,
    np.tile(estimate.poses[view], (len(rows), 1)),
    estimate.ellipsoids[rows],
)
figure, axes = plt.subplots(figsize=(7, 5.3), layout="constrained")
for box, color, style in [(boxes.box, "black", "-"), (predicted, "#D55E00", "--")]:
    for left, top, right, bottom in box:
        corners_u = [left, right, right, left, left]
        axes.plot(corners_u, [top, top, bottom, bottom, top], style, color=color, linewidth=1.3)
for row, corner in zip(rows, boxes.box, strict=True):
    axes.text(corner[0], corner[1] - 4, estimate.class_names[row], fontsize=8)
axes.plot([], [], "-", color="black", label="detected")
axes.plot([], [], "--", color="#D55E00", label="re-projected")
axes.set(
    xlim=(-0.5, estimate.camera.width - 0.5),
    ylim=(estimate.camera.height - 0.5, -0.5),
    aspect="equal",
    xlabel="u [px]",
    ylabel="v [px]",
)
axes.legend(frameon=False, loc="lower left")
plt.show()
