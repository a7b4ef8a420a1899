"""The results of a session: its objects, the objects of its boxes, and its estimate."""

from __future__ import annotations

from bisect import bisect_left
from itertools import pairwise

import numpy as np

from dqslam._checks import Ints
from dqslam.estimate import Estimate
from dqslam.online.objects import Objects
from dqslam.online.state import State


def read_objects(state: State) -> Objects:
    """Return the objects that are in the map."""
    rows = state.object_rows
    votes = [state.registry.votes[row] + state.store.votes(row) for row in rows]
    return Objects(
        object_ids=np.array([state.registry.ids[row] for row in rows], dtype=np.int64),
        class_names=tuple(one.most_common(1)[0][0] for one in votes),
        observations=state.core.observations[rows].astype(np.int64),
        ellipsoids=state.core.ellipsoids[rows],
    )


def read_assignments(state: State, begin: int = 0) -> list[Ints]:
    """Return the ids of the objects that the boxes of each step from ``begin`` on show.

    As known now; -1 for none.
    """
    ids = np.array([*state.registry.ids, -1], dtype=np.int64)
    store, labels = state.store, state.store.labels
    assignments = [one.copy() for one in state.given_ids[begin:]]
    for step, shown in enumerate(assignments, begin):
        if step in store.images:
            boxes, tracklets = store.images[step]
            shown[boxes] = ids[labels.object_of_tracklet[tracklets]]
    first = bisect_left(store.keyframes, begin, key=lambda one: one.pose)
    count = len(store.keyframes)
    ends = np.searchsorted(store.box_keyframe, np.arange(first, count + 1))
    for keyframe, rows in zip(store.keyframes[first:], pairwise(ends.tolist()), strict=True):
        boxes, _ = store.images[keyframe.pose]
        assignments[keyframe.pose - begin][boxes] = ids[labels.object_rows[slice(*rows)]]
    return assignments


def read_estimate(state: State) -> Estimate:
    """Return the estimate in the form of ``solve``, with objects by ascending ids."""
    objects = read_objects(state)
    order = np.argsort(objects.object_ids, kind="stable")
    graph, _ = state.core.to_graph()
    return Estimate(
        pose_model=state.settings.pose_model,
        camera=state.settings.camera,
        timestamps=np.array(state.timestamps),
        poses=state.core.poses,
        initial_poses=graph.initial_poses,
        object_ids=objects.object_ids[order],
        class_names=tuple(objects.class_names[row] for row in order),
        observations=objects.observations[order],
        dual_quadrics=objects.dual_quadrics[order],
        ellipsoids=objects.ellipsoids[order],
        dropped=dict(sorted(state.dropped.items())),
    )
