"""The meshes that ``dqslam shape`` made of objects, for viewers, which draw coarser ones."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from dqslam._checks import Ints
from dqslam.io.files import FileError
from dqslam.surface.files import FOLDER, TABLE, Mesh, read_meshes
from dqslam.view.scene import Scene, rgb
from dqslam.view.surface_mesh import SurfaceMesh

_MOST_CELLS = 1024  # along the longest side of a mesh, which is finer than any that is fused
_STEP = 0.97  # from one size of cells to the next


def has_surfaces(directory: Path) -> bool:
    """Return whether a directory of results has meshes of its objects."""
    return (directory / FOLDER / TABLE).is_file()


def with_surfaces(scene: Scene, directory: Path) -> Scene:
    """Return the scene with the meshes in the folder ``surfaces`` of its results.

    A mesh without colors has that of its object.

    Raises
    ------
    FileError
        If a file is missing or wrong, or a mesh is of an object that the map does not have.
    RuntimeError
        If trimesh is not installed, which reads them.
    """
    if find_spec("trimesh") is None:
        raise RuntimeError("surfaces need trimesh: pip install 'dqslam[surface]'")
    folder = directory / FOLDER
    meshes = read_meshes(folder)
    unknown = meshes.keys() - {one.id for one in scene.objects if one.semi_axes is not None}
    if unknown:
        raise FileError(
            folder / TABLE, f"object {min(unknown)} is not an ellipsoid of the map: run shape again"
        )
    objects = tuple(
        replace(one, surface=_surface(meshes[one.id], one.color)) if one.id in meshes else one
        for one in scene.objects
    )
    return replace(scene, objects=objects)


def _surface(mesh: Mesh, color: str) -> SurfaceMesh:
    colors = mesh.colors
    if colors is None:
        colors = np.tile(np.array(rgb(color), dtype=np.uint8), (len(mesh.vertices), 1))
    return SurfaceMesh(mesh.vertices, mesh.faces, colors)


def coarser(mesh: SurfaceMesh, most: int) -> SurfaceMesh:
    """Return a mesh with at most so many triangles: the vertices in a cell of a grid become one.

    It is at their mean and has the mean of their colors, so the surface stays within a cell of
    where it was. Cells are as small as the number of triangles allows.
    """
    if len(mesh.triangles) <= most:
        return mesh
    low = mesh.vertices.min(axis=0)
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    # A closed surface in n cells along has some 12 n^2 triangles at most. Their number does not
    # fall with each step of n, so the search goes down one by one from where it is too large.
    along = min(float(_MOST_CELLS), 2.0 * np.sqrt(most))
    while along >= 1.0:
        found = _clustered(mesh, np.floor((mesh.vertices - low) * (along / extent)).astype(int))
        if len(found.triangles) <= most:
            return found
        along *= _STEP
    return replace(mesh, triangles=np.zeros((0, 3), dtype=np.int64))


def _clustered(mesh: SurfaceMesh, cells: Ints) -> SurfaceMesh:
    """Return the mesh whose vertices are the cells (v, 3) in which those of a mesh are."""
    _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    vertices, colors = np.zeros((len(counts), 3)), np.zeros((len(counts), 3))
    np.add.at(vertices, cell, mesh.vertices)
    np.add.at(colors, cell, mesh.colors)
    triangles = cell[mesh.triangles]
    corners = np.sort(triangles, axis=1)
    flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2])
    # Where the surface is thinner than a cell, its two sides become the same triangles.
    _, first = np.unique(corners[~flat], axis=0, return_index=True)
    return SurfaceMesh(
        vertices / counts[:, None],
        np.asarray(triangles[~flat][np.sort(first)]),
        np.rint(colors / counts[:, None]).astype(np.uint8),
    )
