"""Depth images of ellipsoids, cuboids and a plane by exact ray casting; shares no line with dqslam.

The world has z up. Rays are (x, y, 1) in the camera frame, so that depth is the ray's parameter.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.io import MapObjects, Results, write_trajectory


@dataclass(frozen=True)
class Ellipsoid:
    """Center, rotation matrix and semi-axes."""

    center: np.ndarray
    turn: np.ndarray
    half: np.ndarray

    def hit(self, origin, rays):
        """Return the first parameter at which rays (..., 3) hit it, infinite without one."""
        o = (origin - self.center) @ self.turn / self.half
        d = rays @ self.turn / self.half
        a, b, c = (d * d).sum(-1), (d * o).sum(-1), (o * o).sum() - 1.0
        inner = b * b - a * c
        with np.errstate(invalid="ignore"):
            found = (-b - np.sqrt(inner)) / a
        return np.where((inner > 0) & (found > 0), found, np.inf)

    def distance(self, points):
        """Return approximate signed distances of points (p, 3) near the surface (first order)."""
        p = (points - self.center) @ self.turn / self.half
        r = np.linalg.norm(p, axis=-1)
        return (r - 1.0) * r / np.linalg.norm(p / self.half, axis=-1)

    @property
    def volume(self):
        return 4.0 / 3.0 * np.pi * self.half.prod()

    @property
    def fitted(self):
        """Semi-axes of the ellipsoid that stands for it in a map."""
        return self.half


@dataclass(frozen=True)
class Cuboid(Ellipsoid):
    """Center, rotation matrix and half-lengths."""

    def hit(self, origin, rays):
        o, d = (origin - self.center) @ self.turn, rays @ self.turn
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-self.half - o) / d, (self.half - o) / d
        low, high = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        return np.where((low < high) & (low > 0), low, np.inf)

    def distance(self, points):
        q = np.abs((points - self.center) @ self.turn) - self.half
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
        return np.where(outside > 0, outside, q.max(-1))

    @property
    def volume(self):
        return 8.0 * self.half.prod()

    @property
    def fitted(self):
        return np.sqrt(5.0 / 3.0) * self.half


@dataclass(frozen=True)
class Floor:
    """The plane z = height."""

    height: float = 0.0

    def hit(self, origin, rays):
        with np.errstate(divide="ignore"):
            found = (self.height - origin[2]) / rays[..., 2]
        return np.where(found > 0, found, np.inf)


def at(*center, half, yaw=0.0, kind=Ellipsoid):
    """Return a body that is turned about z, radians."""
    turn = Rotation.from_euler("z", yaw).as_matrix()
    return kind(np.array(center, dtype=float), turn, np.array(half, dtype=float))


CAMERA = dq.Camera(300.0, 300.0, 159.5, 119.5, 320, 240)


def look_at(position, target, up=(0.0, 0.0, 1.0)):
    """Return world_from_camera (7,) of a camera at a position that looks at a target."""
    forward = np.asarray(target, float) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    turn = np.column_stack([right, np.cross(forward, right), forward])
    return np.concatenate([position, Rotation.from_matrix(turn).as_quat()])


def ring(count, radius, height, target=(0.0, 0.0, 0.0), share=1.0):
    """Return poses (count, 7) on a circle, or on a share of it, that look at a target."""
    angle = 2 * np.pi * share * np.arange(count) / count
    places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + height])
    return np.array([look_at(place + target, target) for place in places])


def all_round(radius=1.5):
    """Return poses that look at the origin from all sides, from above and from below, too."""
    rings = [ring(12, radius, height) for height in (0.0, 0.9, -0.9)]
    poles = [look_at(np.array([0.01, 0.0, z]), np.zeros(3)) for z in (radius, -radius)]
    return np.vstack([*rings, poles])


def cast(poses, things, camera=CAMERA, sigma=0.0, seed=0):
    """Return depth images (k, h, w) [m], 0 where nothing is; noise grows with depth squared."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1
    )
    rng = np.random.default_rng(seed)
    images = []
    for pose in poses:
        turned = rays @ Rotation.from_quat(pose[3:]).as_matrix().T
        depth = np.min([thing.hit(pose[:3], turned) for thing in things], axis=0)
        depth = np.where(np.isfinite(depth) & (depth < 8.0), depth, 0.0)
        images.append(depth + sigma * depth**2 * rng.standard_normal(depth.shape) * (depth > 0))
    return np.array(images)


def results_of(poses, bodies, camera=CAMERA, times=None, directory="results"):
    """Return results whose map has the bodies, and whose path is exact."""
    count = len(bodies)
    return Results(
        directory=Path(directory),
        camera=camera,
        timestamps=0.1 * np.arange(len(poses)) if times is None else times,
        poses=poses,
        initial_poses=poses,
        covariances=np.full((len(poses), 6, 6), np.nan),
        objects=MapObjects(
            object_ids=np.arange(count),
            class_names=("thing",) * count,
            centers=np.array([body.center for body in bodies]).reshape(-1, 3),
            semi_axes=np.array([body.fitted for body in bodies]).reshape(-1, 3),
            orientations=np.array(
                [Rotation.from_matrix(body.turn).as_quat() for body in bodies]
            ).reshape(-1, 4),
            dual_quadrics=np.full((count, 9), np.nan),
            observations=np.full(count, len(poses)),
            center_covariances=np.full((count, 3, 3), np.nan),
            log_semi_axes_sigmas=np.full((count, 3), np.nan),
        ),
        boxes=None,
        report={},
    )


def write_files(folder, results, depth, scale=5000):
    """Write a directory of results, and its depth images as 16-bit PNG in a folder beside it."""
    folder.mkdir()
    mapped, camera = results.objects, results.camera
    for name in ("trajectory.txt", "odometry.txt"):
        write_trajectory(folder / name, results.timestamps, results.poses)
    names = ("fx", "fy", "cx", "cy", "width", "height")
    text = json.dumps({name: getattr(camera, name) for name in names})
    (folder / "camera.json").write_text(text)
    objects = [
        {
            "id": int(mapped.object_ids[row]),
            "class_name": mapped.class_names[row],
            "center": mapped.centers[row].tolist(),
            "semi_axes": mapped.semi_axes[row].tolist(),
            "orientation_xyzw": mapped.orientations[row].tolist(),
            "observations": int(mapped.observations[row]),
        }
        for row in range(len(mapped))
    ]
    (folder / "map.json").write_text(json.dumps({"objects": objects, "dropped": []}))
    images = folder.parent / "depth"
    images.mkdir()
    for time, image in zip(results.timestamps, depth, strict=True):
        values = np.rint(scale * image).astype(np.uint16)
        Image.fromarray(values).save(images / f"{time:.6f}.png")
    return images


def in_world(surface):
    """Return the vertices of a surface in the world, (v, 3)."""
    turn = Rotation.from_quat(surface.orientation_xyzw).as_matrix()
    return surface.vertices @ turn.T + surface.center
