"""Whether the rays through the middles of an object's boxes meet in a point.

They meet if poses, camera and boxes fit together, except for the size of the object and the noise
of its boxes. The median distance of the middles from the projection of the best point is then a few
pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.lens import ideal_pixels

ITERATIONS = 5
# Middles that are farther off than this lose their weight, as false boxes and moved objects [px].
DOUBT_PX = 10.0
# The root mean square angle between rays of a track that a point needs to be determined [rad].
LEAST_PARALLAX = 0.02
NEAREST_M = 1e-6
BEHIND_PX = 1e4  #: the residual of a point behind the camera


@dataclass(frozen=True)
class Views:
    """The poses and the middles of the boxes of t tracks, at most n for each."""

    world_from_camera: NDArray[np.float64]  #: (t, n, 7)
    middle: NDArray[np.float64]  #: (t, n, 2) px, as recorded
    there: NDArray[np.bool_]  #: (t, n) whether it is a view; a shorter track repeats its last one


def inverted(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses (..., 7) read as camera_from_world."""
    return _core.inverse(_core.PoseModel.SE3, poses.reshape(-1, 7)).reshape(poses.shape)


def at_depth_one(camera: _core.Camera, middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return middles (..., 2) px as recorded at depth 1.

    Those beyond the range of the lens, which no right box has, are taken as they were recorded.
    """
    ideal = ideal_pixels(camera, middle) if camera.has_distortion else middle
    ideal = np.where(np.isfinite(ideal), ideal, middle)
    return np.asarray((ideal - [camera.cx, camera.cy]) / [camera.fx, camera.fy])


def residuals(camera: _core.Camera, views: Views) -> NDArray[np.float64]:
    """Return the distance of each middle from the point of its track [px], shape (t, n).

    It is NaN where a track is shorter, or where its rays have no parallax.
    """
    from scipy.spatial.transform import Rotation

    shape = views.there.shape
    focal = np.array([camera.fx, camera.fy])
    normalized = at_depth_one(camera, views.middle)
    poses = views.world_from_camera
    turn = Rotation.from_quat(poses[..., 3:].reshape(-1, 4)).as_matrix().reshape(*shape, 3, 3)
    ray = np.einsum("tnij,tnj->tni", turn, np.dstack([normalized, np.ones(shape)]))
    ray /= np.linalg.norm(ray, axis=2, keepdims=True)
    across = np.eye(3) - ray[..., :, None] * ray[..., None, :]
    # The least eigenvalue is the mean square angle to the direction that the rays share.
    mean = np.einsum("tn,tnij->tij", views.there, across) / views.there.sum(axis=1)[:, None, None]
    spread = np.linalg.eigvalsh(mean)[:, 0]
    flat = spread < LEAST_PARALLAX**2
    across[flat] = np.eye(3)  # any point will do, as it is discarded
    origin = poses[:, :1, :3]
    position = poses[..., :3] - origin
    weight = views.there.astype(float)
    off = np.zeros(shape)
    for _ in range(ITERATIONS):
        # The point nearest to all rays, weighted for robustness and by 1 / depth.
        normal = np.einsum("tn,tnij->tij", weight, across)
        target = np.einsum("tn,tnij,tnj->ti", weight, across, position)
        point = np.linalg.solve(normal, target[..., None])[..., 0]
        local = np.einsum("tnji,tnj->tni", turn, point[:, None] - position)
        ahead = local[..., 2] > NEAREST_M
        depth = np.where(ahead, local[..., 2], 1.0)
        error = (local[..., :2] / depth[..., None] - normalized) * focal
        off = np.where(ahead, np.linalg.norm(error, axis=2), BEHIND_PX)
        weight = views.there / (1 + (off / DOUBT_PX) ** 2) / depth**2
        weight /= weight.max(axis=1, keepdims=True)
    off = np.minimum(off, BEHIND_PX)
    off[~views.there] = np.nan
    off[flat] = np.nan
    return off
