"""
Two maps of one place
=====================

Two robots map one place, each in a frame of its own. :func:`dqslam.align` finds how the frames lie
to each other from the objects that both have, and :func:`dqslam.merge` makes one map of both.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dqslam as dq

# %%
# Two maps
# --------
# Each robot sees 18 of 26 objects, 10 of them are the same. The maps are files with a class and a
# center for each object.

random = np.random.default_rng(3)
world = np.column_stack([random.uniform(0.0, 30.0, (26, 2)), random.normal(0.0, 0.3, 26)])
classes = random.integers(2, size=26)
yaw = 2.1
turn = np.array(
    [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
)
temporary = tempfile.TemporaryDirectory()
first, second, other = (Path(temporary.name) / f"{name}.csv" for name in ("a", "b", "c"))
maps = {}
for name, rows in (("first", np.arange(18)), ("second", np.arange(8, 26))):
    centers = world[rows] + random.normal(0.0, 0.1, (len(rows), 3))
    if name == "second":
        centers = centers @ turn.T + [35.0, 2.0, 0.5]
    maps[name] = centers
    table = np.column_stack([classes[rows], centers])
    path = first if name == "first" else second
    np.savetxt(path, table, delimiter=",", header="class_id,x,y,z", comments="")

# %%
# The motion between them
# -----------------------
# The evidence is the logarithm of the odds against chance, and the runner-up the best other motion.

found = dq.align(first, second)
print(found)
print(np.round(found.b_from_a, 3))
print(f"evidence {found.evidence:.1f}, of the runner-up {found.runner_up.evidence:.1f}")

# %%
# One map
# -------
# Objects that both maps have are joined. The frame is that of the first map.

merged = dq.merge(first, second)
centers = merged.landmarks.centers
back = np.linalg.inv(found.b_from_a)
moved = maps["second"] @ back[:3, :3].T + back[:3, 3]

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
left.plot(*maps["first"][:, :2].T, "o", color="#0072B2", label="first map")
left.plot(*maps["second"][:, :2].T, "s", color="#E69F00", label="second map")
left.set_title("each in its own frame")
right.plot(*centers[:, :2].T, "o", ms=11, mfc="none", color="#888888", label="merged")
right.plot(*maps["first"][:, :2].T, "o", ms=4, color="#0072B2", label="first map")
right.plot(*moved[:, :2].T, "s", ms=4, color="#E69F00", label="second map")
right.set_title(f"{len(found)} objects are in both")
for axes in (left, right):
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(frameon=False, fontsize="small")
plt.show()

# %%
# Where it cannot be told
# -----------------------
# Other objects are no place that both have been at, and the reason is a sentence.

elsewhere = np.column_stack([random.uniform(0.0, 30.0, (18, 2)), random.normal(0.0, 0.3, 18)])
table = np.column_stack([classes[:18], elsewhere])
np.savetxt(other, table, delimiter=",", header="class_id,x,y,z", comments="")
try:
    dq.align(first, other)
except dq.CannotTellError as error:
    print(error)
