"""Commits of local maps: the one place where what boxes show changes, and all that follows."""

from __future__ import annotations

import copy
from collections.abc import Collection, Sequence

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.association import FINAL
from dqslam.association.labels import Labels
from dqslam.assumptions import OdometryNoise, SizePrior
from dqslam.online.local_map import LocalMap
from dqslam.online.objects import ANY_ID
from dqslam.online.state import State

_NO_ELLIPSOIDS = np.zeros((0, 9))


def commit(state: State, local: LocalMap) -> Ints:
    """Let boxes show what a local map found; what has changed since it was made stays.

    Returns the rows of its objects in the session, -1 for one that has no boxes, shape (o,).
    """
    store, scene = state.store, local.scene
    before, count = store.labels, state.core.num_objects
    part = slice(local.first_box, local.first_box + len(scene.labels.tracklets))
    unchanged = before.object_rows[part] == local.base.object_rows[part]
    new = np.unique(scene.labels.object_rows[unchanged])
    new = new[new >= len(local.base.votes)]
    rows = np.arange(len(scene.ellipsoids))
    rows[len(local.base.votes) :] = -1
    rows[new] = count + np.arange(len(new))

    store.labels = _merged(before, local, rows, part, unchanged, count + len(new))
    called = scene.labels.votes[new].argmax(axis=1)
    priors = [scene.size_prior.of(scene.class_names[one]) for one in called.tolist()]
    named = state.settings.trust == FINAL
    ids = [store.tracker_id_of(row) if named else ANY_ID for row in rows[new].tolist()]
    state.registry.register(ids)
    moved = np.flatnonzero(store.labels.object_rows != before.object_rows)
    _relabel(state, moved, before.left_out, scene.ellipsoids[new], priors)
    judged = before.left_out.keys() ^ store.labels.left_out.keys()
    theirs = np.flatnonzero(np.isin(store.labels.object_rows, list(judged)))
    _relabel(state, theirs, store.labels.left_out)
    store.size_prior = scene.size_prior
    if scene.odometry_noise != store.odometry_noise:
        state.core.scale_odometry(*_ratio(scene.odometry_noise, store.odometry_noise))
        store.odometry_noise = scene.odometry_noise
    return rows


def _merged(
    known: Labels, local: LocalMap, rows: Ints, part: slice, unchanged: Bools, count: int
) -> Labels:
    """Return labels with what a local map has changed in them.

    ``rows`` are its objects' among ``count``, ``part`` its boxes, ``unchanged`` those that show
    what they did when it was made.
    """
    base, now = local.base, local.scene.labels
    labels = copy.copy(known)
    labels.make_room(tracklets=len(now.object_of_tracklet), objects=count)
    row_of = np.append(rows, -1)  # of an object of the local map
    kept = np.append(np.arange(count), -1)  # of an object of the session: itself, or joined into
    kept[: len(base.votes)] = row_of[now.joined_into[: len(base.votes)]]

    shown = kept[known.object_rows]
    shown[part] = np.where(unchanged, row_of[now.object_rows], shown[part])
    moved = np.flatnonzero(shown != known.object_rows)
    labels.object_rows = known.object_rows.copy()
    labels.release(moved)
    labels.assign(moved, shown[moved])

    cut = now.tracklets != base.tracklets[part]
    labels.tracklets = known.tracklets.copy()
    labels.tracklets[part] = np.where(cut, now.tracklets, known.tracklets[part])
    own = labels.object_of_tracklet
    then = np.full(len(own), -1)
    then[: len(base.object_of_tracklet)] = base.object_of_tracklet
    found = row_of[now.object_of_tracklet]
    free = own[: len(found)] == then[: len(found)]
    labels.object_of_tracklet = kept[own]
    labels.object_of_tracklet[: len(found)][free] = found[free]

    found_out = {rows[row]: why for row, why in now.left_out.items() if rows[row] >= 0}
    labels.left_out = _changed(known.left_out, base.left_out, found_out)
    return labels


def _changed(
    known: dict[ObjectRow, str], before: dict[ObjectRow, str], now: dict[ObjectRow, str]
) -> dict[ObjectRow, str]:
    """Return what is known, changed as ``before`` became ``now`` but for what is not as before."""
    changed = dict(known)
    for row in before.keys() | now.keys():
        if before.get(row) == now.get(row) or known.get(row) != before.get(row):
            continue
        if row in now:
            changed[row] = now[row]
        else:
            del changed[row]
    return changed


def _relabel(
    state: State,
    boxes: Ints,
    left_out: Collection[ObjectRow],
    ellipsoids: Floats = _NO_ELLIPSOIDS,
    priors: Sequence[SizePrior] = (),
) -> None:
    """Let the core have boxes of the store show what they do, or nothing where that is left out.

    Objects above its own are new: their ellipsoids and size priors are given.
    """
    if not boxes.size:
        return
    shown = state.store.labels.object_rows[boxes]
    state.core.relabel(
        state.store.observation_rows[boxes],
        np.where(np.isin(shown, list(left_out)), -1, shown),
        ellipsoids,
        np.array([prior.log_mean for prior in priors]),
        np.array([prior.log_sigma for prior in priors]),
    )


def _ratio(now: OdometryNoise, before: OdometryNoise) -> tuple[float, float]:
    """Return by which factors the sigmas of translation and rotation have changed."""
    return now.translation_m / before.translation_m, now.rotation_rad / before.rotation_rad
