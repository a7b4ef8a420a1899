"""Positions of objects relative to the camera, from depth images laid onto their fused surfaces.

The surface of an object is the mean of what all images saw. A single image shows where it is from
there: the pixels of the object are moved until they lie on it, by a translation that leaves the
least squares of their distances along its normals. What is measured is the center of the solid, in
the frame of the camera. Directions that the normals do not determine, as along the only face that
is seen, are known to the size of the object only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._files import write_text
from dqslam.io import Results, nearest_pose
from dqslam.recording import RelativePositions
from dqslam.surface.color import vertex_normals
from dqslam.surface.images import DepthImages
from dqslam.surface.surfaces import Surface, Surfaces
from dqslam.surface.views import View, Views

_PIXELS = 3000  # of an object that are laid onto its surface, at most
_LEAST_PIXELS = 50
_STEPS, _STEP_M = 30, 1e-5  # at most, and what ends them before
# Pixels further from the surface than this multiple of the spread of the others do not count.
_OUTLIER = 3.0
# Errors of neighboring pixels are alike: all together are worth so many independent ones.
_INDEPENDENT = 10.0
# The surface itself is known to this share of a voxel.
_SURFACE = 0.3
# An image lies well on the part of the surface that it and its neighbors made, wherever the path
# had them, so positions share the errors of the path. In simulated drives with odometry from 1 mm
# to 1 cm a step, all positions of an object are worth so many independent ones.
_WORTH = 2.0
_COLUMNS = ("timestamp", "object", "x", "y", "z", "c11", "c12", "c13", "c22", "c23", "c33")


def relative_positions(
    results: Results,
    depth: DepthImages,
    surfaces: Surfaces,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> RelativePositions:
    """Measure the centers of objects in the camera frame, one for each box that depth explains.

    ``pose`` are rows of the poses of the results, and ids those of the map. Results have no robot:
    ``object_in_robot`` is in the camera frame. A box has no position
    if its object has no surface, its pose no depth image, or depth shows too little of the object.

    Parameters
    ----------
    results
        Map, path and boxes, from ``load_results``.
    depth
        The images from which the surfaces were fused; for each pose, the one nearest in time.
    surfaces
        What ``fuse_surfaces`` returned for these results.

    Raises
    ------
    ValueError
        If the results have no boxes, or no image is of the time of the path.
    FileError
        If an image cannot be read, or is not of the camera's size.
    """
    boxes = results.boxes
    if boxes is None:
        raise ValueError(f"{results.directory}: has no boxes.csv, whose boxes positions are of")
    views = Views.along(results.camera, results.timestamps, results.poses, depth)
    models = {one.object_id: _Model.of(one) for one in surfaces.surfaces}
    found: list[tuple[int, int, Floats, Floats]] = []
    images = _images_of(results.timestamps, views)
    poses = np.unique(boxes.pose).tolist()
    for done, pose in enumerate(poses, start=1):
        ids = np.unique(boxes.object_id[boxes.pose == pose]).tolist()
        own = [number for number in ids if number in models]
        if own and images[pose] >= 0:
            view = views.view(int(images[pose]))
            for number in own:
                measured = models[number].position(view)
                if measured is not None:
                    found.append((pose, number, *_at_pose(*measured, results.poses[pose])))
        progress(done / len(poses))
    object_id = np.array([one[1] for one in found], dtype=np.int64)
    _, own_row, counts = np.unique(object_id, return_inverse=True, return_counts=True)
    larger = np.maximum(1.0, counts[own_row] / _WORTH)
    return RelativePositions(
        pose=np.array([one[0] for one in found], dtype=np.int64),
        object_id=object_id,
        object_in_robot=np.array([one[2] for one in found]).reshape(-1, 3),
        covariance=larger[:, None, None] * np.array([one[3] for one in found]).reshape(-1, 3, 3),
    )


def _images_of(timestamps: Floats, views: Views) -> Ints:
    """Return the place of the image of each pose, the nearest within half an interval, or -1."""
    if len(views) == 1 or len(timestamps) == 1:
        usual, rows = np.inf, np.zeros(len(timestamps), dtype=np.int64)
        off = np.abs(timestamps - views.times[0])
    else:
        usual = float(np.median(np.diff(timestamps)))
        rows, off = nearest_pose(views.times, timestamps)
    return np.where(off <= 0.5 * usual, rows, -1)


@dataclass(frozen=True, eq=False)
class _Model:
    """A surface to lay images onto, in the world."""

    surface: Surface
    vertices: Floats
    normals: Floats
    tree: Any
    """Finds the nearest of the vertices."""
    center: Floats
    """Of the solid, shape (3,)."""
    center_sigma: float
    """What is not known of the center, because parts of the surface were not seen, meters."""

    @classmethod
    def of(cls, one: Surface) -> _Model:
        from scipy.spatial import KDTree

        solid = one.solid
        used = np.unique(solid.faces[solid.seen])
        normals = vertex_normals(solid.vertices, solid.faces)[used]
        vertices = one.to_world(solid.vertices[used])
        size = float(np.cbrt(abs(solid.volume)))
        return cls(
            surface=one,
            vertices=vertices,
            normals=normals @ one.world_from_object.T,
            tree=KDTree(vertices),
            center=one.to_world(solid.center),
            center_sigma=0.5 * (1.0 - one.seen_share) * size,
        )

    def position(self, view: View) -> tuple[Floats, Floats] | None:
        """Return where an image shows the center in the world, and the covariance of that."""
        points = self._points(view)
        moved = np.zeros(3)
        reach = 2.0 * self.surface.truncation
        normal, rest = np.zeros((0, 3)), np.zeros(0)
        for _ in range(_STEPS):
            away, row = self.tree.query(points - moved, distance_upper_bound=reach)
            near = np.isfinite(away)
            if near.sum() < _LEAST_PIXELS:
                return None
            normal = self.normals[row[near]]
            rest = ((points[near] - moved - self.vertices[row[near]]) * normal).sum(axis=1)
            keep = np.abs(rest - np.median(rest)) <= _OUTLIER * _spread(rest)
            if keep.sum() < _LEAST_PIXELS:
                return None
            normal, rest = normal[keep], rest[keep]
            # Directions without normals stay where they are.
            weak = 1e-3 * np.eye(3)
            step = np.linalg.solve(normal.T @ normal / len(normal) + weak, normal.T @ rest) / len(
                normal
            )
            moved = moved + step
            reach = self.surface.truncation
            if np.linalg.norm(step) < _STEP_M:
                break
        size2 = float(np.sum(np.var(self.vertices, axis=0)))
        spread = max(_spread(rest), _SURFACE * self.surface.voxel)
        facts = _INDEPENDENT / spread**2 * (normal.T @ normal) / len(normal)
        known = np.linalg.inv(facts + np.eye(3) / size2)
        shared = (_SURFACE * self.surface.voxel) ** 2 + self.center_sigma**2
        return self.center + moved, known + shared * np.eye(3)

    def _points(self, view: View) -> Floats:
        """Return the places in the world of pixels that may show the object, (p, 3)."""
        camera, in_camera = view.camera, view.to_camera(self.vertices)
        x, y, z = in_camera[in_camera[:, 2] > 0.0].T
        if not z.size:
            return np.zeros((0, 3))
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        last = np.array([camera.width, camera.height]) - 1
        low = np.clip(np.floor([u.min(), v.min()]), 0, last).astype(int)
        high = np.clip(np.ceil([u.max(), v.max()]), 0, last).astype(int)
        step = max(1, int(np.sqrt(np.prod(high - low + 1) / _PIXELS)))
        u, v = np.meshgrid(
            np.arange(low[0], high[0] + 1, step), np.arange(low[1], high[1] + 1, step)
        )
        depth = view.depth[v, u].astype(float)
        rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 0.0 * u + 1], -1)
        points = (rays * depth[..., None])[depth > 0.0] @ view.world_from_camera.T + view.center
        in_object = self.surface.to_object(points)
        keep = np.ones(len(points), dtype=np.bool_)
        for plane in self.surface.planes:
            keep &= plane.height(in_object) > self.surface.truncation
        return np.asarray(points[keep])


def _spread(values: Floats) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _at_pose(center: Floats, covariance: Floats, pose: Floats) -> tuple[Floats, Floats]:
    """Return a center and a covariance of the world in the camera frame of a pose."""
    from scipy.spatial.transform import Rotation

    camera_from_world = Rotation.from_quat(pose[3:]).as_matrix().T
    turned = camera_from_world @ covariance @ camera_from_world.T
    return camera_from_world @ (center - pose[:3]), 0.5 * (turned + turned.T)


def write_positions(path: Path, results: Results, found: RelativePositions) -> None:
    """Write positions as CSV for ``dqslam run --positions``, with the times of their poses."""
    lines = [",".join(_COLUMNS)]
    rows, columns = np.triu_indices(3)
    for row in range(len(found)):
        numbers = [*found.object_in_robot[row], *found.covariance[row][rows, columns]]
        time = float(results.timestamps[found.pose[row]])
        cells = [repr(time), str(found.object_id[row]), *(f"{x:.9g}" for x in numbers)]
        lines.append(",".join(cells))
    write_text(path, "\n".join(lines) + "\n")
