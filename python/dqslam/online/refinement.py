"""A polish of a session that identifies its boxes: all are assigned again, then all is solved."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association import FINAL
from dqslam.association.follow import Follower
from dqslam.association.refine import refine
from dqslam.association.scene_map import SceneMap
from dqslam.association.thinning import bend_path
from dqslam.online.keyframes import Journal
from dqslam.online.local_map import Part
from dqslam.online.objects import Registry
from dqslam.online.polish import NOTHING, Polished, polished
from dqslam.online.tell import noise_ratio, priors_of, relabel, tell


class Refinement:
    """What ``associate`` does once it knows the whole path, on a copy of a session."""

    def __init__(
        self,
        part: Part,
        journal: Journal,
        registry: Registry,
        session: _core.Session,
        options: _core.SolveOptions,
        *,
        trust: float,
    ) -> None:
        """``part`` has all keyframes; what else is needed of the session is copied."""
        self._part = part
        self._journal = journal
        self._registry = registry
        self._session = session
        self._options = options
        self._copy = session.clone()
        self._keyframes = np.array([frame.pose for frame in journal.keyframes])
        self._first_pose = session.pose_at(0)
        self._trust = trust
        self._noise = journal.odometry_noise

    def work(self) -> Polished:
        """Assign, judge and solve; touches nothing but the copy."""
        part, copy = self._part, self._copy
        scene = part.scene
        shown = _in_estimate(scene)
        refine(Follower(scene, trust=self._trust), lambda share: None)
        shows = _in_estimate(scene)
        born = [row for row in part.born() if row not in scene.left_out]
        rows = np.array([*range(part.objects), *born, -1])  # of the scene, by those of the copy
        shows = np.argsort(rows)[np.searchsorted(rows, shows, sorter=np.argsort(rows))]
        shows = np.where(shows == len(rows) - 1, -1, shows)
        changed = np.flatnonzero(shows != shown)
        told = dict(zip(scene.box_name[changed].tolist(), shows[changed].tolist(), strict=True))
        relabel(copy, told, scene.ellipsoids[born], priors_of(scene, born))
        copy.scale_odometry(*noise_ratio(scene.odometry_noise, self._noise))
        graph, seen = copy.to_graph()
        if not seen:
            return NOTHING
        start = _core.State(self._bent(graph), scene.ellipsoids[rows[seen]])
        return polished(_core.solve(graph, self._options, start), part.objects, rows[seen].tolist())

    def _bent(self, graph: _core.Graph) -> Floats:
        """Return odometry bent to where the keyframes are, its first pose kept, (n, d)."""
        keyframes, poses = self._keyframes, self._part.scene.poses
        if keyframes[0] > 0:
            keyframes = np.concatenate([[0], keyframes])
            poses = np.concatenate([self._first_pose[None], poses])
        return bend_path(graph.pose_model, graph.initial_poses, keyframes, poses)

    def merge(self, found: Polished) -> None:
        """Tell the session what was found; boxes that have found an object meanwhile keep it."""
        part = self._part
        if len(found.poses):
            part.scene.ellipsoids[found.rows] = found.ellipsoids
            self._session.merge(found.poses, part.scene.ellipsoids[: part.objects])
        tell(
            part,
            self._journal,
            self._registry,
            self._session,
            ids_are_final=self._trust == FINAL,
        )


def _in_estimate(scene: SceneMap) -> Ints:
    """Return the object of each box, -1 where it takes no part, shape (m,)."""
    return np.where(np.isin(scene.box_object, list(scene.left_out)), -1, scene.box_object)
