"""What a part of the path says of its boxes, told to the journal, the registry and the session."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.association.scene_map import SceneMap
from dqslam.assumptions import OdometryNoise, SizePrior
from dqslam.online.keyframes import Journal
from dqslam.online.local_map import Part
from dqslam.online.objects import Registry

_T = TypeVar("_T")


def tell(
    part: Part,
    journal: Journal,
    registry: Registry,
    session: _core.Session,
    *,
    ids_are_final: bool,
) -> None:
    """Let boxes show what a part says now; what has changed since it was cut stays.

    Where ids are final, new objects are called what their boxes claim.
    """
    scene = part.scene
    born = part.born()
    number_of = {row: row for row in range(part.objects)}
    number_of |= {row: session.num_objects + place for place, row in enumerate(born)}
    journal.know_objects(session.num_objects)
    journal.bear_objects(len(born))
    told = _take_boxes(part, journal, number_of)
    for given_up in [row for row in scene.joined if row < part.objects]:
        for sight in list(journal.boxes_of(given_up)):  # those before the part
            told[sight] = number_of[_last(scene.joined, given_up)]
            journal.give(sight, told[sight])
    now = {one: number_of[row] for one, row in scene.object_of_tracklet.items() if row in number_of}
    _take_changes(journal.object_of_tracklet, part.object_of_tracklet, now)
    priors = priors_of(scene, born)
    named = sorted(set(told.values()) - {-1})
    new = [number_of[row] for row in born]
    ids = [journal.claim_of(number) if ids_are_final else -1 for number in new]
    registry.take({number: journal.called(number) for number in named}, ids, priors)
    _relabel_known(session, told, journal.left_out, scene.ellipsoids[born], priors)
    why_out = {number_of[row]: why for row, why in scene.left_out.items() if row in number_of}
    left_out = dict(journal.left_out)
    _take_changes(left_out, part.left_out, why_out)
    changed = left_out.keys() ^ journal.left_out.keys()
    journal.left_out = left_out
    told = {sight: number for number in changed for sight in journal.boxes_of(number)}
    _relabel_known(session, told, left_out, np.zeros((0, 9)), [])
    journal.size_prior = scene.size_prior
    if scene.odometry_noise != journal.odometry_noise:
        session.scale_odometry(*noise_ratio(scene.odometry_noise, journal.odometry_noise))
        journal.odometry_noise = scene.odometry_noise
    part.is_taken()


def _take_boxes(part: Part, journal: Journal, number_of: dict[int, int]) -> dict[int, int]:
    """Take over what the boxes of a part show; return what has changed, by row of the session."""
    scene = part.scene
    told = {}
    first = 0
    for frame in journal.keyframes[part.begin :]:
        rows = slice(first, first + len(frame.sight))
        first = rows.stop
        if first > len(scene.box_object):
            break  # it is newer than the part
        cut = scene.tracklet[rows] != part.tracklet[rows]
        frame.tracklet = np.where(cut, scene.tracklet[rows], frame.tracklet)
        now, before = scene.box_object[rows], part.box_object[rows]
        for row in np.flatnonzero((now != before) & (frame.object == before)).tolist():
            sight = int(frame.sight[row])
            told[sight] = number_of[int(now[row])] if now[row] >= 0 else -1
            journal.give(sight, told[sight])
    return told


def _take_changes(known: dict[int, _T], before: dict[int, _T], now: dict[int, _T]) -> None:
    """Change what is known as ``before`` has become ``now``, but for what is no more as before."""
    for key in before.keys() | now.keys():
        if before.get(key) == now.get(key) or known.get(key) != before.get(key):
            continue
        if key in now:
            known[key] = now[key]
        else:
            known.pop(key, None)


def _last(joined: dict[int, int], number: int) -> int:
    """Return the object that another was joined with in the end."""
    while number in joined:
        number = joined[number]
    return number


def _relabel_known(
    session: _core.Session,
    told: dict[int, int],
    left_out: Iterable[int],
    ellipsoids: Floats,
    priors: list[SizePrior],
) -> None:
    """Tell a session what boxes show, but for objects that are left out."""
    hidden = set(left_out)
    shown = {sight: -1 if number in hidden else number for sight, number in told.items()}
    if shown:
        relabel(session, shown, ellipsoids, priors)


def relabel(
    session: _core.Session,
    shown: dict[int, int],
    ellipsoids: Floats,
    priors: list[SizePrior],
) -> None:
    """Tell a session what boxes show, rows of objects; those above its own are new ones."""
    session.relabel(
        np.array(list(shown), dtype=np.int32),
        np.array(list(shown.values()), dtype=np.int32),
        ellipsoids,
        np.array([prior.log_mean for prior in priors]),
        np.array([prior.log_sigma for prior in priors]),
    )


def priors_of(scene: SceneMap, rows: list[int]) -> list[SizePrior]:
    """Return the size priors of objects by their classes."""
    given = scene.size_prior
    if isinstance(given, SizePrior):
        return [given] * len(rows)
    names = scene.recording.detections.class_names
    called = scene.votes[rows].argmax(axis=1)
    return [given.of(names[int(scene.classes[row])]) for row in called.tolist()]


def noise_ratio(now: OdometryNoise, before: OdometryNoise) -> tuple[float, float]:
    """Return by which factors the sigmas of translation and rotation have changed."""
    return now.translation_m / before.translation_m, now.rotation_rad / before.rotation_rad
