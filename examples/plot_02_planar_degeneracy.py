"""
Planar motion leaves tilts open
===============================

A robot that drives straight sees its objects at one heading. This page shows which directions of a
dual quadric the boxes then do not determine, and that an ellipsoid with a broad size prior is
estimated all the same. There is one object, with four motions, known poses, and boxes with a noise
of one pixel. The explanation is in :doc:`/planar_degeneracy`.
"""

import matplotlib.pyplot as plt
import numpy as np

from dqslam.studies.degeneracy import MOTIONS, run_degeneracy

TRIALS = 8
table = run_degeneracy(trials=TRIALS, seed=0)

# %%
# The linear system
# -----------------
# The SVD start solves for the ten entries of Q*. The solution is one null vector. Each further
# singular value at the level of rounding is a direction that the boxes do not determine.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
colors = ["#D55E00", "#E69F00", "#56B4E9", "#0072B2"]
for row, color in zip(table.motions, colors, strict=True):
    values = np.maximum(row.singular_values, 1e-18)
    axes.semilogy(range(1, 11), values, "o-", color=color, label=row.motion, markersize=4)
axes.axhspan(1e-18, 1e-15, color="gray", alpha=0.2)
axes.text(1, 2e-17, "rounding", color="gray")
axes.set(xlabel="singular value", ylabel="over the largest", xticks=range(1, 11))
axes.legend(frameon=False)
plt.show()

# %%
# The error of the object
# -----------------------
# The figure compares the paper's cost on a free dual quadric with an ellipsoid with a size prior,
# both from the SVD start. Above each bar is the share of the results that are ellipsoids.

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
width = 0.35
for side, (estimator, color) in enumerate([("paper", "#E69F00"), ("dqslam", "#0072B2")]):
    rows = [row for row in table.rows if (row.estimator, row.start) == (estimator, "SVD")]
    place = np.arange(len(MOTIONS)) + (side - 0.5) * width
    median_mm = [1e3 * row.center_error_m[1] for row in rows]
    axes.bar(place, median_mm, width, color=color, label=estimator)
    for at, top, row in zip(place, median_mm, rows, strict=True):
        axes.text(at, 1.25 * top, f"{row.ellipsoids:.0%}", ha="center", fontsize=8)
axes.set_yscale("log")
axes.set_ylim(0.1, 1e5)
axes.set_xticks(range(len(MOTIONS)), MOTIONS)
axes.set_ylabel("median error of the center [mm]")
axes.legend(frameon=False)
plt.show()
