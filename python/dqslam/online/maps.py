"""Maps of sessions as files of ``save_estimate``, and their covariances."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats
from dqslam._ids import ObjectId, ObjectRow
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.io import FileError, save_estimate
from dqslam.io.results import GRAPH_FILE, ellipsoid_covariances, load_map_results, read_graph
from dqslam.lens import LensCamera, camera_with, lens_of
from dqslam.online.readout import read_estimate
from dqslam.online.state import State
from dqslam.recording import tangent_size
from dqslam.subgraph import select_objects


@dataclass(frozen=True, eq=False)
class KnownMap:
    """The objects of a loaded map."""

    camera: _core.Camera
    object_ids: list[ObjectId]
    class_names: tuple[str, ...]
    ellipsoids: Floats
    """Shape (o, 9)."""
    covariances: Floats
    """Covariances of the ellipsoids, shape (o, 9, 9)."""


@dataclass(frozen=True, eq=False)
class _Covariances:
    poses: Floats
    objects: Floats


def load_map(directory: str | Path, robot_from_camera: ArrayLike | None = None) -> KnownMap:
    """Read the ellipsoids of a result, and their covariances.

    The mount of the camera is by default that of the problem in the folder, and the identity if it
    has none.
    """
    results = load_map_results(directory)
    saved = results.directory / GRAPH_FILE
    if robot_from_camera is None and saved.is_file():
        robot_from_camera = read_graph(saved).core.camera.robot_from_camera
    objects = results.objects
    rows = np.flatnonzero(objects.is_ellipsoid)
    is_of_no_steps = not len(results.timestamps) and not len(objects)
    if not rows.size and not is_of_no_steps:
        raise FileError(Path(directory) / "map.json", "has no ellipsoid")
    return KnownMap(
        camera=_with_mount(results.camera, robot_from_camera),
        object_ids=objects.object_ids[rows].tolist(),
        class_names=tuple(objects.class_names[row] for row in rows),
        ellipsoids=objects.ellipsoids[rows],
        covariances=ellipsoid_covariances(objects, rows),
    )


def _with_mount(camera: _core.Camera, robot_from_camera: ArrayLike | None) -> _core.Camera:
    if robot_from_camera is None:
        return camera
    return camera_with(camera, lens_of(camera), robot_from_camera=robot_from_camera)


def add_map(state: State, known: KnownMap) -> None:
    """Begin a session with the objects of a map."""
    for one, name, ellipsoid, covariance in zip(
        known.object_ids, known.class_names, known.ellipsoids, known.covariances, strict=True
    ):
        prior = state.prior.of(name)
        state.core.add_map_object(ellipsoid, covariance, prior.log_mean, prior.log_sigma)
        state.registry.register([one])
        state.store.add_map_object(state.registry.row_of[one], name, covariance)


@dataclass(frozen=True, eq=False)
class MapOfSession:
    """The map of a session at one time, which the session does not change any more."""

    estimate: Estimate
    rows: list[ObjectRow]
    """Row of each object of the estimate in the session."""
    known: dict[ObjectRow, Floats]
    """Covariances (9, 9) of a continued map: the problem does not have its priors."""
    problem: tuple[_core.Graph, list[int], _core.State] | None
    """Otherwise the problem, the rows of its objects, and the estimate; None without poses."""
    options: _core.SolveOptions

    @classmethod
    def of(cls, state: State) -> Self:
        """Copy the map of a session."""
        estimate, core, problem = read_estimate(state), state.core, None
        if core.num_poses and not state.store.map_covariance:
            graph, rows = core.to_graph()
            problem = (graph, rows, _core.State(core.poses, core.ellipsoids[rows]))
        return cls(
            estimate=estimate,
            rows=[state.registry.row_of[one] for one in estimate.object_ids.tolist()],
            known=dict(state.store.map_covariance),
            problem=problem,
            options=state.settings.solve_options,
        )

    def covariances(self) -> dict[ObjectRow, Floats]:
        """Return the covariance (9, 9) of each object that has one."""
        if self.problem is None:
            return self.known
        graph, rows, at = self.problem
        if not rows:
            return {}
        found = _core.covariance(graph, self.options, at).objects.reshape(-1, 9, 9)
        determined = np.isfinite(found).all(axis=(1, 2))
        return {ObjectRow(rows[place]): found[place] for place in np.flatnonzero(determined)}

    def save(self, directory: str | Path) -> None:
        """Write the estimate with the covariances of its objects."""
        covariances, unknown = self.covariances(), np.full((9, 9), np.nan)
        objects = np.array([covariances.get(row, unknown) for row in self.rows]).reshape(-1, 9, 9)
        k = tangent_size(self.estimate.pose_model)
        poses = np.full((len(self.estimate.poses), k, k), np.nan)
        save_estimate(
            self.estimate,
            directory,
            marginals=_Covariances(poses, objects),
            graph=self._graph(),
            options=self.options,
        )

    def _graph(self) -> Graph | None:
        """Return the problem of the mapped objects; None where priors of a map are part of it."""
        if self.problem is None or not len(self.estimate.object_ids):
            return None
        core, rows, _ = self.problem
        place = {row: number for number, row in enumerate(rows)}
        if any(row not in place for row in self.rows):
            return None
        core = select_objects(core, np.array([place[row] for row in self.rows], dtype=np.int64))
        return Graph(
            core=core,
            timestamps=self.estimate.timestamps,
            object_ids=self.estimate.object_ids,
            class_names=self.estimate.class_names,
            observations=np.bincount(core.boxes.object, minlength=core.num_objects),
            lens=self.estimate.camera.lens
            if isinstance(self.estimate.camera, LensCamera)
            else None,
        )
