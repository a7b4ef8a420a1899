"""
Where a camera is, and what has changed
=======================================

A map of objects answers two questions later. :func:`dqslam.locate` finds the camera of a single
image by the classes of its boxes. :func:`dqslam.changes` compares two maps of the place.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dqslam as dq

# %%
# A map
# -----
# A camera is carried around a table. The map and the boxes that it was made from are saved.

recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
graph = dq.build_graph(recording)
estimate, summary = dq.solve(graph)
marginals = dq.marginal_covariances(graph, estimate)
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name) / "map"
dq.save_estimate(estimate, folder, detections=recording.detections, marginals=marginals)

# %%
# Where is the camera?
# --------------------
# Every fifth image is located alone, without its place in the sequence and without ids. An answer
# has a covariance and a calibrated confidence; where nothing is sure, it has a reason.

known = dq.load_results(folder)
place = dq.PlaceMap.of(known)
answers = []
for image in range(0, len(recording.timestamps), 5):
    boxes = recording.detections.select(recording.detections.pose == image)
    answers.append((image, dq.locate(place, boxes, recording.camera)))
found = [(image, one) for image, one in answers if one.is_found]
errors = [np.linalg.norm(one.pose[:3] - known.poses[image, :3]) for image, one in found]
print(f"{len(found)} of {len(answers)} images are located, {np.median(errors):.3f} m off")
print("the first:", found[0][1])
print("two boxes are too few:", dq.locate(place, boxes.select(np.arange(2)), recording.camera))

# %%
# What has changed?
# -----------------
# In a later map, one object stands 30 cm from its place.

centers = known.objects.centers.copy()
centers[0, :2] += [0.3, 0.0]
later = replace(known, objects=replace(known.objects, centers=centers))
changed = dq.changes(known, later)
print(changed)
(moved,) = changed.of("moved")
print(f"{moved.class_name}: by {np.linalg.norm(moved.displacement):.2f} m, {moved.probability:.3f}")

figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
axes.plot(*known.poses[:, :2].T, color="#BBBBBB", lw=1, label="path of the map")
axes.plot(*np.array([one.pose[:2] for _, one in found]).T, ".", color="#0072B2", label="located")
axes.plot(*known.objects.centers[:, :2].T, "o", mfc="none", color="#888888", label="objects")
axes.annotate(
    "moved",
    moved.second_center[:2],
    moved.first_center[:2],
    arrowprops={"arrowstyle": "->", "color": "#D55E00"},
    color="#D55E00",
)
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
axes.legend(frameon=False, fontsize="small")
plt.show()
