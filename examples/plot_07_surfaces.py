"""
Surfaces from depth images
==========================

Boxes determine a body for each object. A depth camera shows more: :func:`dqslam.fuse_surfaces`
makes the surface of each object along the estimated path. Laid onto it, each image tells where the
objects are.
"""

import tempfile
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

import dqslam as dq

# %%
# A map
# -----
# A camera goes round a table. The map is estimated from odometry and boxes alone.

recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
recording = replace(recording, positions=None)  # boxes and odometry only
estimate, _ = dq.solve(dq.build_graph(recording))
folder = tempfile.TemporaryDirectory()
dq.save_estimate(estimate, folder.name, detections=recording.detections)
results = dq.load_results(folder.name)
print(results)

# %%
# Depth images
# ------------
# They are cast at the true places of the camera and the objects: the first hit of each ray with the
# table, z = 0, or an ellipsoid. Depth has a noise of 2 mm at 1 m, which grows with its square.

camera, random = recording.camera, np.random.default_rng(0)
u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
rays = np.stack(
    [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1
)
true = replace(estimate, object_ids=truth.object_ids, ellipsoids=truth.ellipsoids)
axes, turns = true.semi_axes, Rotation.from_quat(true.orientations).as_matrix()
cameras = dq._core.world_from_camera(truth.pose_model, camera, truth.poses)


def depth_at(pose):
    """Return the depth image of a true pose."""
    turn, origin = Rotation.from_quat(pose[3:]).as_matrix(), pose[:3]
    down = rays @ turn[2]
    depth = np.where(down < 0, -origin[2] / down, np.inf)
    for center, semi_axes, own in zip(truth.centers, axes, turns, strict=True):
        d, o = rays @ turn.T @ own / semi_axes, (origin - center) @ own / semi_axes
        a, b = (d * d).sum(-1), d @ o
        inside = b * b - a * (o @ o - 1)
        hit = (-b - np.sqrt(inside.clip(0))) / a
        depth = np.where(inside > 0, np.minimum(depth, hit), depth)
    depth = np.where(depth < 5.0, depth, 0.0)
    return depth + 0.002 * depth**2 * random.standard_normal(depth.shape)


rows = np.arange(0, len(cameras), 6)
depth = dq.DepthImages.from_arrays(
    results.timestamps[rows], [depth_at(cameras[row]) for row in rows]
)

# %%
# Surfaces
# --------
# Each is in the frame of its object. The error of a vertex is its distance from the true ellipsoid.

found = dq.fuse_surfaces(results, depth)
print(found)
for one in found.surfaces:
    row = truth.object_ids.tolist().index(one.object_id)
    point = (one.to_world(one.vertices) - truth.centers[row]) @ turns[row] / axes[row]
    radius = np.linalg.norm(point, axis=1)
    error = (radius - 1) * radius / np.linalg.norm(point / axes[row], axis=1)
    print(
        f"{one.object_id}: {100 * one.seen_share:.0f}% seen, median error "
        f"{1e3 * np.median(np.abs(error)):.1f} mm, volume {one.volume / truth.volumes[row]:.3f} "
        "of the true one"
    )

figure = plt.figure(figsize=(8, 4.6), layout="constrained")
space = figure.add_subplot(projection="3d")
for one in found.surfaces:
    x, y, z = one.to_world(one.vertices).T
    space.plot_trisurf(x, y, z, triangles=one.faces, linewidth=0)
space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", aspect="equal")
plt.show()

# %%
# Relative positions
# ------------------
# Each image, laid onto the surfaces, tells where the objects are from its camera. The estimate from
# boxes alone is compared with that; `dqslam run --positions` uses both.

positions = dq.surface.relative_positions(results, depth, found)
print(positions)


def seen_from(poses, centers):
    """Return the measured objects in the cameras at poses (n, 7), with centers (o, 3)."""
    row = np.searchsorted(results.objects.object_ids, positions.object_id)
    own = Rotation.from_quat(poses[positions.pose, 3:]).as_matrix()
    return np.einsum("pji,pj->pi", own, centers[row] - poses[positions.pose, :3])


same = np.searchsorted(truth.object_ids, results.objects.object_ids)
expected = seen_from(cameras, truth.centers[same])
for name, one in (
    ("estimated from boxes", seen_from(results.poses, results.objects.centers)),
    ("measured by depth", positions.object_in_robot),
):
    error = np.linalg.norm(one - expected, axis=1)
    print(f"{name}: {1e3 * np.median(error):.1f} mm from the truth in the median")
