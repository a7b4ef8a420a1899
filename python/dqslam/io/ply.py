"""A map as PLY, for MeshLab, CloudCompare, Blender and trimesh.

Vertices are ``x y z`` [m] in the world of the map, with a color and the ``object_id`` to which they
belong, -1 for the trajectory. Ellipsoids have faces, and an object that is not an ellipsoid is one
vertex. The trajectory has its positions, with an ``edge`` from each to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._files import write_text
from dqslam.io.results import Results

_RINGS, _SECTORS = 16, 32


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


def unit_sphere() -> tuple[Floats, Ints]:
    """Return vertices (v, 3) on the unit sphere and triangles (f, 3), counter-clockwise outside."""
    polar = np.linspace(0.0, np.pi, _RINGS + 1)[1:-1]
    around = 2.0 * np.pi * np.arange(_SECTORS) / _SECTORS
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.outer(np.cos(polar), np.ones(_SECTORS)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.vstack([[[0.0, 0.0, 1.0]], rings, [[0.0, 0.0, -1.0]]])
    last = len(vertices) - 1
    here = np.arange(_SECTORS)
    beside = np.roll(here, -1)
    faces = [np.column_stack([np.zeros_like(here), 1 + here, 1 + beside])]
    for ring in range(_RINGS - 2):
        upper, lower = 1 + ring * _SECTORS, 1 + (ring + 1) * _SECTORS
        faces.append(np.column_stack([upper + here, lower + here, lower + beside]))
        faces.append(np.column_stack([upper + here, lower + beside, upper + beside]))
    final = 1 + (_RINGS - 2) * _SECTORS
    faces.append(np.column_stack([final + here, np.full_like(here, last), final + beside]))
    return vertices, np.vstack(faces)


def _lines(
    results: Results, colors: Sequence[tuple[int, int, int]], trajectory_color: tuple[int, int, int]
) -> Iterator[str]:
    objects, path = results.objects, results.poses[:, :3]
    sphere, triangles = unit_sphere()
    bodies = [_body(results, row, sphere) for row in range(len(objects))]
    meshed = int(objects.is_ellipsoid.sum())
    yield (
        "ply\nformat ascii 1.0\ncomment a map by dqslam, meters\n"
        f"element vertex {sum(map(len, bodies)) + len(path)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "property int object_id\n"
        f"element face {meshed * len(triangles)}\nproperty list uchar int vertex_indices\n"
        f"element edge {max(len(path) - 1, 0)}\nproperty int vertex1\nproperty int vertex2\n"
        "end_header\n"
    )
    for body, color, number in zip(bodies, colors, objects.object_ids, strict=True):
        yield from _vertices(body, color, int(number))
    yield from _vertices(path, trajectory_color, -1)
    first = 0
    for body, is_mesh in zip(bodies, objects.is_ellipsoid, strict=True):
        if is_mesh:
            yield from (f"3 {a} {b} {c}\n" for a, b, c in (triangles + first).tolist())
        first += len(body)
    yield from (f"{first + k} {first + k + 1}\n" for k in range(len(path) - 1))


def _body(results: Results, row: int, sphere: Floats) -> Floats:
    """Return the vertices of an object, (v, 3); only its center if it is not an ellipsoid."""
    from scipy.spatial.transform import Rotation

    objects = results.objects
    if not objects.is_ellipsoid[row]:
        return objects.centers[[row]]
    world_from_object = Rotation.from_quat(objects.orientations[row])
    scaled = sphere * objects.semi_axes[row]
    return np.asarray(world_from_object.apply(scaled) + objects.centers[row])


def _vertices(points: Floats, color: tuple[int, int, int], number: int) -> Iterator[str]:
    red, green, blue = color
    for x, y, z in points.tolist():
        yield f"{x:.6f} {y:.6f} {z:.6f} {red} {green} {blue} {number}\n"
