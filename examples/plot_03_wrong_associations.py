"""
A fifth of the ids are wrong
============================

A box with a wrong id pulls an object, and with it the path, to the place of another object. Least
squares trusts every box. A robust loss finds the boxes that do not fit, and reports them.
"""

import matplotlib.pyplot as plt

import dqslam as dq

# %%
# The drive is the same as before, but one box in five has the id of another object.

scenario = dq.load_scenario("paper")
detector = scenario.detector.model_copy(update={"wrong_associations": 0.2})
recording, truth = dq.simulate(scenario.model_copy(update={"detector": detector}), seed=1)
is_right = recording.detections.object_id == truth.box_object_id
print(f"{len(is_right)} boxes, {(~is_right).sum()} of them with a wrong id")

# %%
# Three estimates
# ---------------
# Graduated non-convexity with the Geman-McClure loss reduces the weights of boxes that do not fit
# in several rounds. ``dqslam paper`` uses it if ids are wrong.

graph = dq.build_graph(recording)
estimates = {
    "least squares": dq.solve(graph)[0],
    "Huber": dq.solve(graph, dq.SolveOptions(loss=dq.Loss.HUBER))[0],
    "GNC, Geman-McClure": dq.solve(graph, dq.SolveOptions(loss=dq.Loss.GNC_GM))[0],
}
figure, panels = plt.subplots(
    1, 3, figsize=(10, 3.6), sharex=True, sharey=True, layout="constrained"
)
for axes, (name, estimate) in zip(panels, estimates.items(), strict=True):
    report = dq.evaluate(estimate, truth)
    axes.plot(*estimate.initial_poses[:, :2].T, color="#0072B2", linewidth=1, label="odometry")
    axes.plot(*truth.poses[:, :2].T, color="#009E73", linewidth=3, alpha=0.7, label="truth")
    axes.plot(*estimate.poses[:, :2].T, color="#D55E00", linewidth=1.2, label="estimate")
    axes.plot(*truth.centers[:, :2].T, "s", color="#009E73", alpha=0.5)
    axes.plot(*estimate.centers[:, :2].T, "+", color="#D55E00")
    axes.set_title(f"{name}: {report.rmse_pos:.2f} m", fontsize=10)
    axes.set(aspect="equal", xlabel="x [m]", xlim=(-13, 16), ylim=(-7, 17))
panels[0].set_ylabel("y [m]")
figure.legend(
    *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
)
plt.show()

# %%
# The rejected boxes
# ------------------
# ``Estimate.inliers`` has a flag for each box that fits. Compared with the truth of the simulation:

fits = estimates["GNC, Geman-McClure"].inliers
print(f"right ids among the boxes that fit: {is_right[fits].mean():.1%}")
print(f"boxes with right ids that fit:      {fits[is_right].mean():.1%}")
for object_id, why in estimates["GNC, Geman-McClure"].dropped.items():
    print(f"object {object_id} is not in the map: {why}")
