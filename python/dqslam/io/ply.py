"""A map as PLY, for MeshLab, CloudCompare, Blender and trimesh.

Vertices are ``x y z`` [m] in the world of the map, with a color and the ``object_id`` to which they
belong, -1 for the trajectory. Ellipsoids, cuboids and cylinders have faces, and an object that has
no surface is one vertex. The trajectory has its positions, with an ``edge`` from each to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam._files import write_text
from dqslam.io.results import Results
from dqslam.solids import Mesh, mesh


def write_ply(
    path: str | Path,
    results: Results,
    colors: Sequence[tuple[int, int, int]],
    trajectory_color: tuple[int, int, int],
) -> None:
    """Write the objects and the trajectory of an estimate.

    Parameters
    ----------
    colors
        Red, green and blue of each object, 0 to 255.
    trajectory_color
        Red, green and blue of the trajectory, 0 to 255.
    """
    if len(colors) != len(results.objects):
        raise ValueError(f"colors: expected {len(results.objects)}, got {len(colors)}")
    write_text(path, _lines(results, colors, trajectory_color))


def _lines(
    results: Results, colors: Sequence[tuple[int, int, int]], trajectory_color: tuple[int, int, int]
) -> Iterator[str]:
    objects, path = results.objects, results.poses[:, :3]
    solids = objects.solids
    meshes = [
        mesh(solids, row)
        if has_surface
        else Mesh(objects.centers[[row]], np.zeros((0, 3), dtype=np.int64))
        for row, has_surface in enumerate(solids.has_surface)
    ]
    yield (
        "ply\nformat ascii 1.0\ncomment a map by dqslam, meters\n"
        f"element vertex {sum(len(one.vertices) for one in meshes) + len(path)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "property int object_id\n"
        f"element face {sum(len(one.triangles) for one in meshes)}\n"
        "property list uchar int vertex_indices\n"
        f"element edge {max(len(path) - 1, 0)}\nproperty int vertex1\nproperty int vertex2\n"
        "end_header\n"
    )
    for one, color, number in zip(meshes, colors, objects.object_ids, strict=True):
        yield from _vertices(one.vertices, color, int(number))
    yield from _vertices(path, trajectory_color, -1)
    first = 0
    for one in meshes:
        yield from (f"3 {a} {b} {c}\n" for a, b, c in (one.triangles + first).tolist())
        first += len(one.vertices)
    yield from (f"{first + k} {first + k + 1}\n" for k in range(len(path) - 1))


def _vertices(points: Floats, color: tuple[int, int, int], number: int) -> Iterator[str]:
    red, green, blue = color
    for x, y, z in points.tolist():
        yield f"{x:.6f} {y:.6f} {z:.6f} {red} {green} {blue} {number}\n"
