"""
A loop with known truth
=======================

A robot drives twice around a simulated room with ten objects. Its odometry drifts. A detector draws
boxes, with the id of the object in each. From odometry and boxes alone, :func:`dqslam.solve`
estimates the path and the objects.
"""

import matplotlib.pyplot as plt
import numpy as np

import dqslam as dq

# %%
# What was recorded
# -----------------
# A scenario has the settings of the world, and a seed draws one world and one drive. The recording
# is everything that an estimator may use.

scenario = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
recording, truth = dq.simulate(scenario, seed=4)
print(f"{len(recording.timestamps)} poses, {len(recording.detections)} boxes")

# %%
# The estimate
# ------------
# A graph is the least-squares problem as plain arrays. The boxes have a noise of one pixel, and the
# objects really are ellipsoids. The box noise is set accordingly.

graph = dq.build_graph(recording, box_noise=dq.BoxNoise(pixels=1.0, relative=0.0))
estimate, summary = dq.solve(graph)
print(summary)
print(dq.evaluate(estimate, truth))

# %%
# The uncertainty
# ---------------
# Covariances are relative to the first pose, which is fixed. Those of poses are in the frame of the
# pose itself. They are rotated into the world for the figure.

marginals = dq.marginal_covariances(graph, estimate)
heading = estimate.poses[:, 2]
turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
turn = turn.transpose(2, 0, 1)
position_covariance = turn @ marginals.poses[:, :2, :2] @ turn.transpose(0, 2, 1)
sigma = np.sqrt(np.trace(position_covariance, axis1=1, axis2=2))
print(f"standard deviation of the last position: {sigma[-1]:.2f} m")


# %%
# The map from above
# ------------------
# From above, an ellipsoid of center c and shape S is the ellipse of the upper left block of S.
# Small ellipses along the path contain the position with 95 %, and are enlarged five times.


def ellipse(center, shape, scale=1.0):
    """Return the outline of an ellipse, shape (2, n)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return center[:2, None] + scale * np.linalg.cholesky(shape[:2, :2]) @ circle


BLUE, GREEN, RED = "#0072B2", "#009E73", "#D55E00"
figure, axes = plt.subplots(figsize=(8, 5.4), layout="constrained")
axes.plot(*estimate.initial_poses[:, :2].T, color=BLUE, linewidth=1.2, label="odometry")
axes.plot(*truth.poses[:, :2].T, color=GREEN, linewidth=4, alpha=0.6, label="truth")
axes.plot(*estimate.poses[:, :2].T, color=RED, linewidth=1.2, label="estimate")
for row in range(12, len(estimate.poses), 12):
    inside = ellipse(estimate.poses[row], position_covariance[row], scale=5 * 2.45)
    axes.plot(*inside, color=RED, linewidth=0.6)
for ellipsoid in truth.ellipsoids:
    factor = np.zeros((3, 3))
    factor[np.diag_indices(3)] = np.exp(ellipsoid[3:6])
    factor[np.tril_indices(3, -1)] = ellipsoid[6:9]
    axes.fill(*ellipse(ellipsoid[:3], factor @ factor.T), color=GREEN, alpha=0.5, linewidth=0)
for center, shape in zip(estimate.centers, estimate.shapes, strict=True):
    axes.plot(*ellipse(center, shape), color=RED, linewidth=1.2)
axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.1), ncols=3, frameon=False)
plt.show()

# %%
# The error along the way
# -----------------------
# The error of odometry grows with every turn. The estimate is corrected as soon as objects of the
# first round are seen again in the second one, and its errors agree with its covariances.

error = np.linalg.norm(estimate.poses[:, :2] - truth.poses[:, :2], axis=1)
drift = np.linalg.norm(estimate.initial_poses[:, :2] - truth.poses[:, :2], axis=1)
figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
axes.fill_between(recording.timestamps, 1e-3, 3.0 * sigma, color=RED, alpha=0.15, label="3 sigma")
axes.plot(recording.timestamps, np.maximum(drift, 1e-3), color=BLUE, label="odometry")
axes.plot(recording.timestamps, np.maximum(error, 1e-3), color=RED, label="estimate")
axes.set(xlabel="time [s]", ylabel="position error [m]", xlim=(0, None))
axes.set(yscale="log", ylim=(0.01, 20.0))
axes.legend(frameon=False)
plt.show()
