"""A polish of a session that identifies its boxes: all are assigned again, then all is solved."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam.association.follow import Follower
from dqslam.association.refine import refine
from dqslam.association.thinning import bend_path
from dqslam.online.commit import commit
from dqslam.online.local_map import local_map
from dqslam.online.polish import NOTHING, Polish, Polished
from dqslam.online.state import State


def refine_all(state: State) -> Polish:
    """Make a polish that does what ``associate`` does once it knows the whole path."""
    local, trial = local_map(state, 0), state.copy()
    keyframes = np.array([frame.pose for frame in state.store.keyframes])
    first_pose = state.core.pose_at(0)
    settings, scene, num_objects = state.settings, local.scene, state.core.num_objects

    def work() -> Polished:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # as in each step
            refine(scene, Follower(trust=settings.trust))
        row_of = commit(trial, local)
        graph, seen = trial.core.to_graph()
        if not seen:
            return NOTHING
        own = np.argsort(row_of)  # rows of the scene, by those of the trial
        rows = own[np.searchsorted(row_of, seen, sorter=own)].tolist()
        # Odometry bent to where the keyframes are, its first pose kept.
        ends, poses = keyframes, scene.poses
        if ends[0] > 0:
            ends, poses = np.append(0, ends), np.concatenate([first_pose[None], poses])
        bent = bend_path(graph.pose_model, graph.initial_poses, ends, poses)
        start = _core.State(bent, scene.ellipsoids[rows])
        solution = _core.solve(graph, settings.solve_options, start)
        return Polished.of(solution, num_objects, rows)

    def merge(found: Polished) -> None:
        if len(found.poses):
            scene.ellipsoids[found.object_rows] = found.ellipsoids
            state.core.merge(found.poses, scene.ellipsoids[:num_objects])
        commit(state, local)

    return Polish(work, merge)
