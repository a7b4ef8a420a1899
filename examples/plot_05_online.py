"""
Step by step
============

A robot needs its present pose. :class:`dqslam.OnlineSlam` takes odometry and boxes as they arrive,
does bounded work for each step, and has an estimate at any time. This page compares the pose after
each step, the path at the end of the drive, and the path after a polish.
"""

import matplotlib.pyplot as plt
import numpy as np

import dqslam as dq

scenario = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
recording, truth = dq.simulate(scenario, seed=4)

# %%
# The loop of a robot
# -------------------
# ``steps_of`` replays a recording: each step has a time, the motion since the last one, and boxes.
# The pose after each step is stored, and compared with the complete path at the end.

slam = dq.OnlineSlam(recording.camera, box_noise=dq.BoxNoise(pixels=1.0, relative=0.0))
now = []
linearized = []
for step in dq.steps_of(recording):
    report = slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    now.append(slam.pose)
    linearized.append(report.linearized)
now = np.array(now)
last = slam.poses
slam.polish()
polished = slam.poses
print(f"{len(slam)} steps, {len(slam.objects.object_ids)} objects")


# %%
# The errors over time
# --------------------


def error(path):
    """Return the distance of each pose from its true place, meters."""
    return np.linalg.norm(path[:, :2] - truth.poses[:, :2], axis=1)


drift = dq.build_graph(recording).core.initial_poses
figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
for path, color, name in [
    (drift, "#0072B2", "odometry"),
    (now, "#E69F00", "at the time"),
    (last, "#D55E00", "the path at the end"),
    (polished, "#009E73", "polished"),
]:
    axes.plot(recording.timestamps, np.maximum(error(path), 1e-3), color=color, label=name)
axes.set(xlabel="time [s]", ylabel="position error [m]", yscale="log", xlim=(0, None))
axes.set_ylim(0.005, 20)
axes.legend(frameon=False, ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.16))
plt.show()

# %%
# The work of a step
# ------------------
# The measure is the number of linearized boxes. They are few for the window of recent poses. They
# are more if objects of the first round are seen again and the path since then is corrected.

figure, axes = plt.subplots(figsize=(8, 2.8), layout="constrained")
axes.semilogy(recording.timestamps, np.maximum(linearized, 1), ".", color="#0072B2")
axes.set(xlabel="time [s]", ylabel="boxes linearized", xlim=(0, None))
plt.show()
