"""Commits of local maps: the one place where what boxes show changes, and all that follows."""

from __future__ import annotations

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
    store, core, scene = state.store, state.core, local.scene
    before, known = store.labels, len(local.base.votes)
    part = slice(local.first_box, local.first_box + len(scene.labels.tracklets))
    unchanged = before.object_rows[part] == local.base.object_rows[part]
    new = np.unique(scene.labels.object_rows[unchanged])
    new = new[new >= known]
    rows = np.full(len(scene.ellipsoids), -1)
    rows[:known] = np.arange(known)
    rows[new] = core.num_objects + np.arange(len(new))

    after = _merged(before, local, part, rows, core.num_objects + len(new))
    called = scene.labels.votes[new].argmax(axis=1)
    priors = [scene.size_prior.of(scene.class_names[one]) for one in called.tolist()]
    moved = after.object_rows != before.object_rows
    _relabel(state, after, moved, before.dropped, scene.ellipsoids[new], priors)
    judged = before.dropped.keys() ^ after.dropped.keys()
    _relabel(state, after, np.isin(after.object_rows, list(judged)), after.dropped)
    store.labels = after
    named = state.settings.trust == FINAL
    ids = [store.tracker_id_of(row) if named else ANY_ID for row in rows[new].tolist()]
    for one in ids:  # an object that was given up leaves its id to the one that takes its boxes
        row = state.registry.row_of.get(one)
        if row is not None and not (after.object_rows == row).any():
            state.registry.release(one)
    state.registry.register(ids)
    store.size_prior = scene.size_prior
    if scene.odometry_noise not in (None, store.odometry_noise):
        core.scale_odometry(*_ratio(scene.odometry_noise, store.odometry_noise))
        store.odometry_noise = scene.odometry_noise
    return rows


def _merged(known: Labels, local: LocalMap, part: slice, rows: Ints, count: int) -> Labels:
    """Return what is known with what a local map has changed in it.

    ``part`` are its boxes in the store, ``rows`` its objects among the ``count`` of the session.
    """
    base, now = local.base, local.scene.labels
    row_of = np.append(rows, -1)
    kept = np.append(np.arange(count), -1)  # itself, or the object that it was joined into
    kept[: len(base.votes)] = row_of[now.joined_into[: len(base.votes)]]
    merged = known.since(0)
    merged.make_room(tracklets=len(now.object_of_tracklet), objects=count)

    shown = kept[known.object_rows]
    shown[part] = _changed(shown[part], kept[base.object_rows[part]], row_of[now.object_rows])
    moved = np.flatnonzero(shown != known.object_rows)
    merged.release(moved)
    merged.assign(moved, shown[moved])
    merged.tracklets[part] = _changed(known.tracklets[part], base.tracklets[part], now.tracklets)
    own, begun = kept[merged.object_of_tracklet], len(base.object_of_tracklet)
    found = row_of[now.object_of_tracklet]
    own[:begun] = _changed(own[:begun], kept[base.object_of_tracklet], found[:begun])
    own[begun : len(found)] = found[begun:]  # of tracklets that were cut
    merged.object_of_tracklet = own
    dropped = {ObjectRow(int(rows[row])): why for row, why in now.dropped.items()}
    asked = known.dropped.keys() | dropped.keys()
    free = {row for row in asked if known.dropped.get(row) == base.dropped.get(row)}
    merged.dropped = {row: why for row, why in known.dropped.items() if row not in free}
    merged.dropped |= {row: why for row, why in dropped.items() if row in free and row >= 0}
    return merged


def _changed(known: Ints, before: Ints, now: Ints) -> Ints:
    """Return what is known, changed as ``before`` became ``now`` but for what is not as before."""
    return np.where(known == before, now, known)


def _relabel(
    state: State,
    labels: Labels,
    changed: Bools,
    dropped: Collection[ObjectRow],
    ellipsoids: Floats = _NO_ELLIPSOIDS,
    priors: Sequence[SizePrior] = (),
) -> None:
    """Let the core have changed boxes (m,) show what they do, or nothing where that is left out.

    Objects above its own are new: their ellipsoids and size priors are given.
    """
    if not changed.any():
        return
    shown = labels.object_rows[changed]
    state.core.relabel(
        state.store.observation_rows[changed],
        np.where(np.isin(shown, list(dropped)), -1, shown),
        ellipsoids,
        np.array([prior.log_mean for prior in priors]),
        np.array([prior.log_sigma for prior in priors]),
    )


def _ratio(now: OdometryNoise, before: OdometryNoise) -> tuple[float, float]:
    """Return by which factors the sigmas of translation and rotation have changed."""
    return now.translation_m / before.translation_m, now.rotation_rad / before.rotation_rad
