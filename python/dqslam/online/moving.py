"""What moves, as the last images of a session show it.

Only a window of the last images is looked at, so the work does not grow with the session. Within
it, the path is that of the session, or of the odometry where the map has something at rest that
moves, and as uncertain as the odometry that leads through the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Ints
from dqslam.association import FINAL
from dqslam.online.inputs import CheckedBoxes
from dqslam.online.readout import read_assignments
from dqslam.online.state import State
from dqslam.recording import Detections, Odometry, Recording
from dqslam.track import Track
from dqslam.tracks import estimate_tracks, find_moving, path_by_odometry

# A track needs four images, hence nothing moves in a shorter window.
_FEWEST_STEPS = 4


@dataclass(frozen=True, eq=False)
class Window:
    """The last images of a session."""

    begin: int
    """Step of the first one."""
    recording: Recording
    """With the ids that the boxes were given."""
    object_rows: Ints
    """Object of the session's map that each box shows, -1 for none, shape (m,)."""


def track_recent(state: State) -> tuple[Track, ...]:
    """Return the tracks of what moves in the last images; ``Track.pose`` are steps of the session.

    What the map has at rest is judged, too, by the path of the odometry.
    """
    if len(state.recent) < _FEWEST_STEPS:
        return ()
    window = recent_window(state)
    recording, rows = window.recording, window.object_rows
    settings, ellipsoids = state.settings, state.core.ellipsoids
    path, covariance = path_by_odometry(recording)
    moving = find_moving(
        recording,
        path,
        ellipsoids,
        rows,
        box_noise=settings.box_noise,
        size_prior=settings.size_prior,
        path_covariance=covariance,
    )
    steps = np.arange(len(recording.timestamps)) + window.begin
    # A map that has a mover at rest has a path that makes it rest: then odometry is believed.
    found = estimate_tracks(
        recording,
        path if moving else state.core.poses_at(steps.tolist()),
        ellipsoids,
        np.where(np.isin(rows, list(moving)), -1, rows),
        final=settings.believes_ids or settings.trust == FINAL,
        box_noise=settings.box_noise,
        size_prior=settings.size_prior,
        path_covariance=covariance,
    )
    return tuple(replace(track, pose=track.pose + window.begin) for track in found.tracks)


def recent_window(state: State) -> Window:
    """Return the last images of a session of two steps at least, with what their boxes show."""
    steps, begin = list(state.recent), len(state.timestamps) - len(state.recent)
    shown = read_assignments(state, begin)
    row_of = {state.registry.ids[row]: row for row in state.object_rows}
    object_rows = [row_of.get(one, -1) for one in np.concatenate(shown).tolist()]
    odometry = Odometry(
        state.settings.pose_model,
        state.core.pose_at(begin),
        np.array([one.relative for one in steps[1:]]),
        np.array([one.covariance for one in steps[1:]]),
    )
    recording = Recording(
        state.settings.camera,
        np.array(state.timestamps[begin:]),
        odometry,
        _detections([one.boxes for one in steps]),
    )
    return Window(begin, recording, np.array(object_rows, dtype=np.int64))


def _detections(images: Sequence[CheckedBoxes]) -> Detections:
    """Return the boxes of some images as detections, all of them as sure."""
    names = [name for one in images for name in one.class_name]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    counts = [len(one.box) for one in images]
    return Detections(
        np.repeat(np.arange(len(images)), counts),
        np.concatenate([one.box for one in images]).reshape(-1, 4),
        np.ones(len(names)),
        np.array([numbers[name] for name in names], dtype=np.int64),
        np.concatenate([one.object_id for one in images]).astype(np.int64),
        {number: name for name, number in numbers.items()},
        np.concatenate([one.truncated for one in images]).reshape(-1, 4).astype(np.bool_),
    )
