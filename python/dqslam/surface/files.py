"""Surfaces as files: a mesh of each object as PLY and GLB, and ``surfaces.json`` about all.

Meshes are in the frame of their object, so that they move with it when the map changes. GLB has
that frame too, although many viewers take its y for up.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from dqslam._checks import Floats, Ints, as_floats
from dqslam._files import whole_file
from dqslam.io.files import FileError, read_text, write_json
from dqslam.surface.images import Colors
from dqslam.surface.surfaces import Surface, Surfaces

TABLE = "surfaces.json"
FOLDER = "surfaces"  #: in a directory of results


@dataclass(frozen=True, eq=False)
class Mesh:
    """A mesh of an object, as read from a file."""

    object_id: int
    vertices: Floats
    """In the frame of the object, meters, shape (v, 3)."""
    faces: Ints
    """Rows of vertices, shape (f, 3)."""
    colors: Colors | None
    """Red, green and blue of each vertex, 0 to 255, shape (v, 3)."""


def write_surfaces(
    folder: Path, found: Surfaces, progress: Callable[[float], None] = lambda share: None
) -> None:
    """Write ``object_ID.ply`` and ``object_ID.glb`` of each surface, and ``surfaces.json``."""
    import trimesh

    for number, one in enumerate(found.surfaces, start=1):
        mesh = trimesh.Trimesh(
            one.vertices, one.faces, vertex_colors=one.colors, process=False, validate=False
        )
        for suffix in ("ply", "glb"):
            with whole_file(folder / f"{_name(one.object_id)}.{suffix}") as path:
                mesh.export(path)
        progress(number / len(found.surfaces))
    write_json(folder / TABLE, described(found))


def described(found: Surfaces) -> dict[str, Any]:
    """Return the numbers of surfaces as plain data."""
    return {
        "images": found.images,
        "images_left_out": found.images_left_out,
        "objects": [_object(one) for one in found.surfaces],
        "left_out": [{"id": number, "reason": why} for number, why in found.left_out.items()],
    }


def _object(one: Surface) -> dict[str, Any]:
    return {
        "id": one.object_id,
        "class_name": one.class_name,
        "mesh": f"{_name(one.object_id)}.ply",
        "center": one.center,
        "orientation_xyzw": one.orientation_xyzw,
        "images": one.images,
        "voxel_m": one.voxel,
        "truncation_m": one.truncation,
        "vertices": len(one.vertices),
        "faces": len(one.faces),
        "has_colors": one.colors is not None,
        "volume_m3": one.volume,
        "extents_m": one.extents,
        "seen_share": one.seen_share,
        "planes": [
            {"normal": plane.normal, "offset_m": plane.offset, "roughness_m": plane.roughness}
            for plane in one.planes
        ],
    }


def _name(object_id: int) -> str:
    return f"object_{object_id}"


def read_meshes(folder: str | Path) -> dict[int, Mesh]:
    """Read the meshes that ``surfaces.json`` of a folder lists, by the ids of their objects.

    Raises
    ------
    FileError
        If a file is missing or wrong.
    """
    folder = Path(folder)
    path = folder / TABLE
    try:
        content = json.loads(read_text(path))
        listed = [(int(one["id"]), str(one["mesh"])) for one in content["objects"]]
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except (KeyError, TypeError, ValueError):
        raise FileError(path, "has no list of objects with their id and mesh") from None
    return {number: _read_mesh(folder / name, number) for number, name in listed}


def _read_mesh(path: Path, object_id: int) -> Mesh:
    import trimesh

    if not path.is_file():
        raise FileError(path, "no such file")
    try:
        mesh = cast(Any, trimesh.load(path, process=False, force="mesh"))
        vertices = np.array(as_floats("vertices", mesh.vertices, [None, 3]))  # which may be changed
        faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # whatever trimesh raises on a wrong file
        raise FileError(path, f"cannot be read as a mesh: {error}") from None
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise FileError(path, "a face has a vertex that is not there")
    visual = mesh.visual
    has_colors = visual.kind == "vertex" and len(visual.vertex_colors) == len(vertices)
    colors = np.array(visual.vertex_colors[:, :3], dtype=np.uint8) if has_colors else None
    return Mesh(object_id, vertices, faces, colors)
