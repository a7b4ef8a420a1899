"""Read the files that ``save_estimate`` wrote."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints, as_floats, as_ints
from dqslam._exchange import standing
from dqslam._manifest import check_files, complete_manifest, read_manifest
from dqslam._repr import counted
from dqslam.io.camera import read_camera
from dqslam.io.files import FileError, read_text
from dqslam.io.results.boxes import BoxTable, read_boxes
from dqslam.io.results.covariances import read_covariances
from dqslam.io.results.graph_file import GRAPH_FILE
from dqslam.io.results.save import NO_POSES
from dqslam.io.results.tracks import read_tracks
from dqslam.io.trajectory import Trajectory, read_trajectory
from dqslam.solids import Solids, body_solids
from dqslam.track import Track

RESULT_FILES = (
    "trajectory.txt",
    "odometry.txt",
    "camera.json",
    "map.json",
    "covariance.csv",
    "boxes.csv",
    "tracks.csv",
    "report.json",
    GRAPH_FILE,
)
_MOST_READINGS = 5


@dataclass(frozen=True, eq=False)
class MapObjects:
    """The objects of ``map.json``, in its order."""

    object_ids: Ints
    """Shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    centers: Floats
    """In the world, meters, shape (o, 3)."""
    semi_axes: Floats
    """Descending, meters, shape (o, 3); NaN for an object that is no ellipsoid."""
    orientations: Floats
    """world_from_object, x y z w, shape (o, 4); NaN for an object that is no ellipsoid."""
    dual_quadrics: Floats
    """q1 .. q9 with Q*(4,4) = 1, shape (o, 9); NaN if the file has none."""
    observations: Ints
    """Number of boxes that were used, shape (o,)."""
    center_covariances: Floats
    """Square meters, shape (o, 3, 3); NaN if unknown."""
    log_semi_axes_sigmas: Floats
    """Sigmas of the natural logarithms of the semi-axes, shape (o, 3); NaN if unknown."""
    object_shapes: tuple[_core.Shape, ...] = ()
    """The shape of each object; empty if all are ellipsoids. For a cuboid or a cylinder,
    `semi_axes`, `orientations` and `dual_quadrics` are of the ellipsoid with the same moments."""
    half_lengths: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """Meters, shape (o, 3), the third of a cylinder along its axis; NaN for an ellipsoid. Empty
    if all are ellipsoids, as are the next two."""
    rotation_vectors: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """world_from_object of a cuboid or a cylinder, rad, shape (o, 3)."""
    log_half_lengths_sigmas: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """Sigmas of the natural logarithms of the half-lengths, shape (o, 3); NaN if unknown."""
    dropped: Mapping[int, str] = field(default_factory=dict)
    """Reasons why objects are not in the map, by their ids."""
    doubtful: Mapping[int, str] = field(default_factory=dict)
    """Reasons why the size or shape of an object is not to be believed, by their ids."""
    contradicted: Mapping[int, str] = field(default_factory=dict)
    """Reasons why the boxes of mapped objects contradict them, by their ids."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.object_ids)

    def __repr__(self) -> str:
        """Show how many objects there are."""
        dropped = f", {len(self.dropped)} dropped" if self.dropped else ""
        return f"MapObjects({counted(len(self), 'object')}{dropped})"

    @property
    def is_ellipsoid(self) -> Bools:
        """Whether each object is a real ellipsoid, shape (o,)."""
        return np.asarray(np.isfinite(self.semi_axes).all(axis=1))

    @property
    def ellipsoids(self) -> Floats:
        """Center and log-Cholesky shape, shape (o, 9); NaN for an object that is no ellipsoid."""
        rows = np.full((len(self), 9), np.nan)
        for row in np.flatnonzero(self.is_ellipsoid):
            axes, turn = self.semi_axes[row], self.orientations[row]
            rows[row] = _core.ellipsoid_from_axes(self.centers[row], axes, turn)
        return rows

    @property
    def is_body(self) -> Bools:
        """Whether each object is a cuboid or a cylinder, shape (o,)."""
        if not self.object_shapes:
            return np.zeros(len(self), dtype=np.bool_)
        return np.array(
            [one != _core.Shape.ELLIPSOID for one in self.object_shapes], dtype=np.bool_
        )

    @property
    def solids(self) -> Solids:
        """The surfaces of the objects, to draw, project and compare."""
        return body_solids(
            self.object_shapes,
            self.ellipsoids,
            self.centers,
            self.half_lengths,
            self.rotation_vectors,
        )

    @property
    def volumes(self) -> Floats:
        """Volume [m^3] of each object in its own shape, (o,); NaN for no ellipsoid."""
        return self.solids.volumes


@dataclass(frozen=True, eq=False)
class Results:
    """The content of all files of an estimate."""

    directory: Path
    camera: _core.Camera
    """The camera without a mount, because the poses are those of the camera."""
    timestamps: Floats
    """Seconds, shape (n,)."""
    poses: Floats
    """world_from_camera, shape (n, 7)."""
    initial_poses: Floats
    """world_from_camera by odometry alone, shape (n, 7)."""
    covariances: Floats
    """Covariances of the poses in the frame of the camera, x y z [m] and rotation vector [rad].

    Shape (n, 6, 6), NaN if unknown. The first pose is exact.
    """
    objects: MapObjects
    boxes: BoxTable | None
    """The boxes, or None without ``boxes.csv``."""
    report: Mapping[str, Any]
    """The content of ``report.json``, empty without it."""
    tracks: tuple[Track, ...] = ()
    """What moves, from ``tracks.csv``; none without it."""

    def __repr__(self) -> str:
        """Show where the files are, and how many poses and objects are in them."""
        poses, objects = counted(len(self.poses), "pose"), counted(len(self.objects), "object")
        return f"Results({str(self.directory)!r}, {poses}, {objects})"


def load_results(directory: str | Path) -> Results:
    """Read a directory of results.

    ``covariance.csv``, ``boxes.csv``, ``tracks.csv`` and ``report.json`` may be absent. If there
    is a ``manifest.json``, the files are compared with it: for each that has been changed, added or
    taken away since they were written, there is a ``ChangedFileWarning``.

    Raises
    ------
    FileError
        If a file is missing or wrong; the error names it, and its line if it has lines. Or if the
        manifest says that the writing of the files was interrupted.

    Examples
    --------
    The names are those of an estimate. Objects are under ``objects``, and poses are the camera's:

    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> estimate, summary = dq.solve(dq.build_graph(recording))
    >>> dq.save_estimate(estimate, "results/seed7")
    >>> results = dq.load_results("results/seed7")
    >>> results.poses.shape, results.objects.centers.shape
    ((253, 7), (10, 3))
    """
    found = load_map_results(directory)
    if not len(found.timestamps):
        raise FileError(found.directory / "trajectory.txt", "holds no pose: it is a map alone")
    return found


def load_map_results(directory: str | Path) -> Results:
    """Read a directory of results as ``load_results`` does, or that of a session without steps."""
    directory = Path(directory)
    for _ in range(_MOST_READINGS):
        folder = standing(directory)
        if not folder.is_dir():
            raise FileError(directory, "no such directory")
        before = complete_manifest(folder)
        try:
            found: Results | FileError = _read_results(folder)
        except FileError as error:
            found = error
        if read_manifest(standing(directory)) == before:
            break  # else another process has written new results meanwhile
    if isinstance(found, FileError):
        raise found
    check_files(folder, RESULT_FILES)
    return found


def _read_results(directory: Path) -> Results:
    times, poses = _read_path(directory / "trajectory.txt")
    odometry_times, odometry = _read_path(directory / "odometry.txt")
    if not np.array_equal(times, odometry_times):
        message = f"its times are not those of {directory / 'trajectory.txt'}"
        raise FileError(directory / "odometry.txt", message)
    covariance = directory / "covariance.csv"
    boxes, report = directory / "boxes.csv", directory / "report.json"
    tracks = directory / "tracks.csv"
    return Results(
        directory=directory,
        camera=read_camera(directory / "camera.json"),
        timestamps=times,
        poses=poses,
        initial_poses=odometry,
        covariances=read_covariances(covariance, times)
        if covariance.exists()
        else np.full((len(times), 6, 6), np.nan),
        objects=read_map(directory / "map.json"),
        boxes=read_boxes(boxes, times) if boxes.exists() else None,
        report=_read_json(report) if report.exists() else {},
        tracks=read_tracks(tracks, times) if tracks.exists() else (),
    )


def _read_path(path: Path) -> Trajectory:
    """Read a path; that of a session without steps is a comment that says so."""
    with contextlib.suppress(OSError, UnicodeDecodeError):
        if path.read_text(encoding="utf-8") == NO_POSES:
            return Trajectory(np.zeros(0), np.zeros((0, 7)))
    return read_trajectory(path)


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    if not isinstance(content, dict):
        raise FileError(path, "holds no table of named values")
    return content


def read_map(path: str | Path) -> MapObjects:
    """Read a ``map.json``; an error names the file and the row of the object."""
    path = Path(path)
    content = _read_json(path)
    objects = content.get("objects")
    if not isinstance(objects, list) or not all(isinstance(entry, dict) for entry in objects):
        raise FileError(path, "has no list of objects")
    required = ("id", "class_name", "center", "semi_axes", "orientation_xyzw", "observations")
    for row, entry in enumerate(objects):
        missing = [name for name in required if name not in entry]
        if missing:
            raise FileError(path, f"objects row {row}: missing {', '.join(missing)}")
    try:
        found = MapObjects(
            object_ids=as_ints("objects id", _column(objects, "id")),
            class_names=tuple(str(entry["class_name"]) for entry in objects),
            centers=as_floats("objects center", _column(objects, "center"), [None, 3]),
            semi_axes=_maybe(objects, "semi_axes", (3,)),
            orientations=_maybe(objects, "orientation_xyzw", (4,)),
            dual_quadrics=_maybe(objects, "dual_quadric", (4, 4))[:, *np.triu_indices(4)][:, :9],
            observations=as_ints("objects observations", _column(objects, "observations")),
            center_covariances=_maybe(objects, "center_covariance", (3, 3)),
            log_semi_axes_sigmas=_maybe(objects, "log_semi_axes_sigma", (3,)),
            object_shapes=_shapes(objects),
            half_lengths=_maybe(objects, "half_lengths", (3,)),
            rotation_vectors=_maybe(objects, "rotation_vector", (3,)),
            log_half_lengths_sigmas=_maybe(objects, "log_half_lengths_sigma", (3,)),
            dropped={int(one["id"]): str(one["reason"]) for one in content.get("dropped", [])},
            doubtful={int(one["id"]): str(one["doubt"]) for one in objects if one.get("doubt")},
            contradicted={
                int(one["id"]): str(one["contradicted"])
                for one in content["objects"]
                if "contradicted" in one
            },
        )
    except (ValueError, TypeError, KeyError) as error:
        raise FileError(path, str(error)) from None
    _check(path, found)
    return found


def _check(path: Path, found: MapObjects) -> None:
    ids, counts = np.unique(found.object_ids, return_counts=True)
    if (counts > 1).any():
        raise FileError(path, f"id {ids[counts > 1][0]} occurs twice")
    norm = np.linalg.norm(found.orientations, axis=1)
    wrong = (found.semi_axes <= 0.0).any(axis=1) | (np.abs(norm - 1.0) > 1e-6)
    wrong |= np.isfinite(norm) != found.is_ellipsoid
    if wrong.any():
        row = int(np.argmax(wrong))
        message = f"objects row {row}: semi_axes and orientation_xyzw are of no ellipsoid"
        raise FileError(path, message)
    given = np.isfinite(found.half_lengths).all(axis=1) & (found.half_lengths > 0.0).all(axis=1)
    given &= np.isfinite(found.rotation_vectors).all(axis=1) & found.is_ellipsoid
    if (found.is_body & ~given).any():
        row = int(np.argmax(found.is_body & ~given))
        shape = found.object_shapes[row].name.lower()
        message = f"objects row {row}: a {shape} needs positive half_lengths and a rotation_vector"
        raise FileError(path, message)


def _shapes(objects: list[dict[str, Any]]) -> tuple[_core.Shape, ...]:
    """Return the shape of each object; those without one are ellipsoids. Empty if all are."""
    known = {name.lower(): _core.Shape[name] for name in ("ELLIPSOID", "CUBOID", "CYLINDER")}
    shapes = []
    for row, entry in enumerate(objects):
        name = entry.get("shape") or "ellipsoid"
        if name not in known:
            expected = ", ".join(known)
            raise ValueError(f"objects row {row}: shape {name!r} is none of {expected}")
        shapes.append(known[name])
    return () if set(shapes) <= {_core.Shape.ELLIPSOID} else tuple(shapes)


def _column(objects: list[dict[str, Any]], name: str) -> list[Any]:
    return [entry[name] for entry in objects]


def _maybe(objects: list[dict[str, Any]], name: str, shape: tuple[int, ...]) -> Floats:
    """Return the finite entries, shape (o, *shape); NaN for one that is absent or null."""
    table = np.full((len(objects), *shape), np.nan)
    for row, entry in enumerate(objects):
        if entry.get(name) is not None:
            table[row] = as_floats(f"objects row {row} {name}", entry[name], shape)
    return table
