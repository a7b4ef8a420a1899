"""The problem that an estimate solves, as a file: ``graph.npz``.

It has the tables of the problem (odometry, boxes and their objects, measurements, priors, the
camera and its mount), the estimate, and the options of the solver: what is needed to solve it
again, alone or together with that of another recording. Arrays are those of ``np.savez``, by the
names of the attributes of the problem; ``settings`` is a JSON text of all else.
"""

from __future__ import annotations

import enum
import json
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._files import FileError
from dqslam.estimate import Estimate
from dqslam.lens import Lens

GRAPH_FILE = "graph.npz"
_FORMAT = 1
_ODOMETRY = ("from_pose", "to_pose", "relative", "covariance")
_BOXES = ("pose", "object", "box", "covariance", "truncated")
_SIZES = ("log_mean", "log_sigma", "shared")
_PLACEMENTS = ("object", "other", "shared", "distance", "sigma")
_MEASUREMENT = ("pose", "object", "value", "covariance")
_NUMBERS = ("fx", "fy", "cx", "cy", "width", "height")
_SCENE = ("camera_height", "camera_height_sigma", "plane_offset", "support_sigma", "upright_sigma")
_ENUMS = (
    *(_core.Backend, _core.LandmarkModel, _core.Loss, _core.Minimizer, _core.Mode),
    *(_core.Residual, _core.Schedule, _core.Start),
)


class Problem(Protocol):
    """A problem with the ids and names of its rows, as ``Graph``."""

    @property
    def core(self) -> _core.Graph:
        """The tables."""

    @property
    def timestamps(self) -> Floats:
        """Seconds, shape (n,)."""

    @property
    def object_ids(self) -> Ints:
        """Ascending, shape (o,)."""

    @property
    def class_names(self) -> tuple[str, ...]:
        """One per object."""

    @property
    def observations(self) -> Ints:
        """Number of boxes of each object, shape (o,)."""

    @property
    def lens(self) -> Lens | None:
        """The lens of the camera, if the core does not know its model."""


@dataclass(frozen=True, eq=False)
class SavedGraph:
    """The content of ``graph.npz``."""

    core: _core.Graph
    timestamps: Floats
    """Seconds, shape (n,)."""
    object_ids: Ints
    """Ascending, shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    observations: Ints
    """Number of boxes of each object, shape (o,)."""
    lens: Lens | None
    poses: Floats
    """The estimate: world_from_robot, shape (n, d)."""
    landmarks: Floats
    """The estimate of the objects, shape (o, 9); NaN for one that was dropped."""
    options: _core.SolveOptions
    """With which it was solved."""


def write_graph(
    path: Path, graph: Problem, estimate: Estimate, options: _core.SolveOptions
) -> None:
    """Write a problem and its solution."""
    core = graph.core
    is_body = bool(estimate.object_shapes)
    landmarks = np.full((len(graph.object_ids), 9), np.nan)
    _, rows, estimated = np.intersect1d(
        graph.object_ids, estimate.object_ids, assume_unique=True, return_indices=True
    )
    landmarks[rows] = (estimate.landmarks if is_body else estimate.ellipsoids)[estimated]
    arrays: dict[str, Any] = {
        "timestamps": graph.timestamps,
        "object_ids": graph.object_ids,
        "class_names": np.array(graph.class_names, dtype=np.str_),
        "observations": graph.observations,
        "initial_poses": core.initial_poses,
        "poses": estimate.poses,
        "landmarks": landmarks,
        "robot_from_camera": core.camera.robot_from_camera,
        "distortion": core.camera.distortion,
        "up": core.scene_priors.up,
        "shared_sigma": core.shared_sigma,
    }
    tables: list[tuple[str, Any, tuple[str, ...]]] = [
        ("odometry", core.odometry, _ODOMETRY),
        ("boxes", core.boxes, _BOXES),
        ("size_prior", core.size_prior, _SIZES),
        ("placements", core.placements, _PLACEMENTS),
    ]
    tables += [(f"measured_{t.kind}", t, _MEASUREMENT) for t in core.measurements]
    for name, table, columns in tables:
        arrays |= {f"{name}.{column}": getattr(table, column) for column in columns}
    settings = {
        "format": _FORMAT,
        "pose_model": core.pose_model.name,
        "camera": {name: getattr(core.camera, name) for name in _NUMBERS},
        "lens": None if graph.lens is None else [graph.lens.model, list(graph.lens.parameters)],
        "scene_priors": {name: getattr(core.scene_priors, name) for name in _SCENE},
        "shapes": [shape.name for shape in core.shapes],
        "placements": [kind.name for kind in core.placements.kind],
        "measurements": [table.kind for table in core.measurements],
        "options": {name: _plain(getattr(options, name)) for name in _names(options)},
    }
    arrays["settings"] = np.array(json.dumps(settings))
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def read_graph(path: str | Path) -> SavedGraph:
    """Read what ``write_graph`` wrote.

    Raises
    ------
    FileError
        If the file is missing or wrong.
    """
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, TypeError) as error:
        raise FileError(path, f"is no file of arrays: {error}") from None
    try:
        return _parsed(arrays)
    except KeyError as error:
        raise FileError(path, f"has no {error.args[0]}") from None
    except (ValueError, TypeError, AttributeError, IndexError) as error:
        raise FileError(path, f"is no problem that dqslam has written: {error}") from None


def _parsed(arrays: dict[str, Any]) -> SavedGraph:
    settings = json.loads(str(arrays["settings"]))
    if settings["format"] != _FORMAT:
        raise ValueError(f"format {settings['format']}, and {_FORMAT} is known")

    def table(name: str, columns: tuple[str, ...]) -> dict[str, Any]:
        return {column: arrays[f"{name}.{column}"] for column in columns}

    core = _core.Graph(
        _core.PoseModel[settings["pose_model"]],
        _core.Camera(
            **settings["camera"],
            distortion=arrays["distortion"],
            robot_from_camera=arrays["robot_from_camera"],
        ),
        initial_poses=arrays["initial_poses"],
        odometry=_core.OdometryTable(**table("odometry", _ODOMETRY)),
        boxes=_core.BoxTable(**table("boxes", _BOXES)),
        size_prior=_core.SizePriorTable(**table("size_prior", _SIZES)),
        measurements=[
            _core.MeasurementTable(kind=kind, **table(f"measured_{kind}", _MEASUREMENT))
            for kind in settings["measurements"]
        ],
        scene_priors=_core.ScenePriors(**settings["scene_priors"], up=arrays["up"]),
        shapes=[_core.Shape[name] for name in settings["shapes"]],
        shared_sigma=arrays["shared_sigma"],
        placements=_core.PlacementTable(
            kind=[_core.Placement[name] for name in settings["placements"]],
            **table("placements", _PLACEMENTS),
        ),
    )
    lens = settings["lens"]
    known = dict(timestamps=core.num_poses, observations=core.num_objects)
    known |= dict(object_ids=core.num_objects, class_names=core.num_objects)
    known |= dict(poses=core.num_poses, landmarks=core.num_objects)
    for name, count in known.items():
        if len(arrays[name]) != count:
            raise ValueError(f"{name} has {len(arrays[name])} rows, {count} are needed")
    if (np.diff(arrays["object_ids"]) <= 0).any():
        raise ValueError("object_ids do not ascend")
    return SavedGraph(
        core=core,
        timestamps=arrays["timestamps"],
        object_ids=arrays["object_ids"],
        class_names=tuple(arrays["class_names"].tolist()),
        observations=arrays["observations"],
        lens=None if lens is None else Lens(lens[0], tuple(lens[1])),
        poses=arrays["poses"],
        landmarks=arrays["landmarks"],
        options=_core.SolveOptions(
            **{name: _option(value) for name, value in settings["options"].items()}
        ),
    )


def _names(options: _core.SolveOptions) -> list[str]:
    # No result depends on the number of threads.
    return [name for name in dir(options) if not name.startswith("_") and name != "threads"]


def _plain(value: Any) -> Any:
    """Return a number as it is, and an enumerator as its type and its name."""
    return [type(value).__name__, value.name] if isinstance(value, enum.Enum) else value


def _option(value: Any) -> Any:
    if not isinstance(value, list):
        return value
    types = {one.__name__: one for one in _ENUMS}
    return types[value[0]][value[1]]
