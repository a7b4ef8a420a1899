"""Colors of the vertices of surfaces, from images in which depth shows that they are seen."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.surface.images import Colors
from dqslam.surface.views import View

GREY = 160  #: of vertices that no image shows


class Painter:
    """Vertices in the world, and the weighted mean of the colors in which images show them."""

    def __init__(self, vertices: Floats, normals: Floats, tolerance: float) -> None:
        """Take vertices (v, 3) [m] and their outward unit normals (v, 3).

        A vertex is seen in an image if its depth is within ``tolerance`` m of the image's.
        """
        self._vertices, self._normals, self._tolerance = vertices, normals, tolerance
        self._sum = np.zeros((len(vertices), 3))
        self._weight = np.zeros(len(vertices))

    def paint(self, view: View, color_view: View, image: Colors) -> None:
        """Add the colors of an image, whose camera is that of ``color_view``, seen as in ``view``.

        The depth of both cameras differs by the little that they moved between their times.
        """
        u, v, z, inside = _pixels(view, self._vertices)
        seen = np.zeros(len(u), dtype=np.bool_)
        seen[inside] = np.abs(view.depth[v[inside], u[inside]] - z[inside]) < self._tolerance
        to_camera = color_view.center - self._vertices
        distance = np.linalg.norm(to_camera, axis=1)
        cosine = np.einsum("vi,vi->v", to_camera, self._normals) / distance
        u, v, _, inside = _pixels(color_view, self._vertices)
        seen &= inside & (cosine > 0.0)
        weight = np.square(cosine[seen]) / np.square(distance[seen])
        self._sum[seen] += weight[:, None] * image[v[seen], u[seen]]
        self._weight[seen] += weight

    def colors(self) -> Colors:
        """Return the colors of all vertices, (v, 3); ``GREY`` where no image shows them."""
        known = self._weight > 0.0
        found = np.full((len(self._sum), 3), GREY, dtype=np.uint8)
        found[known] = np.rint(self._sum[known] / self._weight[known, None]).astype(np.uint8)
        return found


def vertex_normals(vertices: Floats, faces: np.ndarray) -> Floats:
    """Return outward unit normals (v, 3), the means of those of the faces by their areas."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], across)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _pixels(view: View, points: Floats) -> tuple[np.ndarray, np.ndarray, Floats, np.ndarray]:
    """Return the nearest pixels and depths of points in the world, and whether they are inside."""
    x, y, z = view.to_camera(points).T
    camera = view.camera
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.where(z > 0.0, camera.fx * x / z + camera.cx, -1.0)
        v = np.where(z > 0.0, camera.fy * y / z + camera.cy, -1.0)
    u = np.rint(np.clip(u, -1.0, camera.width)).astype(int)
    v = np.rint(np.clip(v, -1.0, camera.height)).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return u, v, z, inside
