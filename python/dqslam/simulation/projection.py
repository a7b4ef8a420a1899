"""The exact boxes and outlines of objects in the images of a drive."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import Camera, PoseModel

_OUTLINE_POINTS = 128  # of an ellipse: a polygon that is 0.03 % of its size inside of it


@dataclass(frozen=True, eq=False)
class Views:
    """A camera and the poses of the robot that carries it."""

    camera: Camera
    pose_model: PoseModel
    poses: Floats
    """world_from_robot, shape (n, d)."""

    def distances(self, center: Floats) -> Floats:
        """Return the distances of centers (o, 3) from the cameras, meters, shape (n, o)."""
        eye = _core.world_from_camera(self.pose_model, self.camera, self.poses)[:, :3]
        return np.asarray(np.linalg.norm(center[None] - eye[:, None], axis=2))


class Bodies(Protocol):
    """Convex bodies that are seen in images."""

    def boxes(self, views: Views) -> tuple[Floats, Bools]:
        """Return the exact boxes, (n, o, 4), px, and which bodies are strictly in front, (n, o)."""
        ...

    def outline(self, views: Views, pose: int, row: int) -> Floats:
        """Return the outline of one body from one pose, a closed convex polygon (k, 2), px."""
        ...


@dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Ellipsoids by their parameters."""

    parameters: Floats
    """Center and log-Cholesky shape, shape (o, 9)."""

    def boxes(self, views: Views) -> tuple[Floats, Bools]:
        """Project all ellipsoids."""
        count, objects = len(views.poses), len(self.parameters)
        box, in_front = _core.project_to_boxes(
            views.pose_model,
            views.camera,
            np.repeat(views.poses, objects, axis=0),
            np.tile(self.parameters, (count, 1)),
        )
        return box.reshape(count, objects, 4), in_front.reshape(count, objects)

    def outline(self, views: Views, pose: int, row: int) -> Floats:
        """Return a polygon inside of the ellipse."""
        pose_row, body = views.poses[pose][None], self.parameters[row][None]
        outlines = _core.project_to_outlines(
            views.pose_model, views.camera, pose_row, body, points=_OUTLINE_POINTS
        )
        return np.asarray(outlines[0])


@dataclass(frozen=True, eq=False)
class Polyhedra:
    """Convex polyhedra by their corners."""

    corners: Floats
    """In the world, meters, shape (o, 3, k)."""

    def boxes(self, views: Views) -> tuple[Floats, Bools]:
        """Bound the projected corners."""
        u, v, in_front = _project(views, self.corners)
        return np.stack([u.min(2), v.min(2), u.max(2), v.max(2)], axis=2), in_front

    def outline(self, views: Views, pose: int, row: int) -> Floats:
        """Return the convex hull of the projected corners."""
        from scipy.spatial import ConvexHull

        one = Views(views.camera, views.pose_model, views.poses[pose][None])
        u, v, _ = _project(one, self.corners[row][None])
        points = np.column_stack([u[0, 0], v[0, 0]])
        around = ConvexHull(points).vertices
        return np.asarray(points[[*around, around[0]]])


def centers_in_robot(model: PoseModel, poses: Floats, center: Floats) -> Floats:
    """Return the objects' centers in the frames of all robots, meters, shape (n, o, 3)."""
    from scipy.spatial.transform import Rotation

    in_place = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)  # its frame is the robot's
    world_from_robot = _core.world_from_camera(model, in_place, poses)
    rotation = Rotation.from_quat(world_from_robot[:, 3:]).as_matrix()
    from_robot = center[None] - world_from_robot[:, None, :3]
    return np.asarray(np.einsum("nji,noj->noi", rotation, from_robot))


def _project(views: Views, corners: Floats) -> tuple[Floats, Floats, Bools]:
    """Return u and v (n, o, k), NaN for a body that is not in front as a whole, and which is."""
    from scipy.spatial.transform import Rotation

    camera = views.camera
    world_from_camera = _core.world_from_camera(views.pose_model, camera, views.poses)
    rotation = Rotation.from_quat(world_from_camera[:, 3:]).as_matrix()
    from_camera = corners[None] - world_from_camera[:, None, :3, None]  # (n, o, 3, k)
    x, y, z = np.moveaxis(np.einsum("nji,nojc->noic", rotation, from_camera), 2, 0)
    in_front = (z > 0.0).all(axis=2)
    z = np.where(in_front[:, :, None], z, np.nan)
    return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, in_front
