"""Tracks of what moves against the true ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io import Results, TrueTrack
from dqslam.metrics import Alignment
from dqslam.track import Track
from dqslam.uncertainty import normalized_squares

# A track is one of a thing if it is no farther from it than this in the median, meters.
GATE_OF_TRACKS = 5.0


def evaluate_tracks(
    results: Results,
    truth: Sequence[TrueTrack],
    alignment: Alignment,
    *,
    gate: float | None = None,
    max_time_difference: float | None = None,
) -> dict[str, Any]:
    """Compare each track with the true one that is nearest to it, where one is near.

    Errors of position are those in the world of the truth. Those of motion, from an image to the
    next pose of the recording, and of speed have next to nothing of the errors of the path. Values
    that no track has are None.

    Parameters
    ----------
    alignment
        true_from_estimated.
    gate
        The largest median distance of a track from its thing, meters; ``GATE_OF_TRACKS`` by
        default.
    max_time_difference
        Times that differ by at most this, in seconds, are the same; by default half the median
        interval of the poses.
    """
    tolerance = max_time_difference
    if tolerance is None:
        tolerance = 0.5 * float(np.median(np.diff(results.timestamps)))
    limit = GATE_OF_TRACKS if gate is None else gate
    pairs, errors = [], []
    for track in results.tracks:
        found = _nearest(track, results.timestamps, truth, alignment, tolerance)
        if found is None or found[1] > limit:
            continue
        thing = found[0]
        rows, true_rows = _common(track, results.timestamps, thing, tolerance)
        one = _errors(track, rows, thing, true_rows, alignment)
        errors.append(one)
        pairs.append(
            {
                "id": track.track_id,
                "true_id": thing.track_id,
                "class_name": track.class_name,
                "images": len(rows),
                "position": _median(one["position"]),
                "motion": _median(one["motion"]),
                "speed": _median(one["speed"]),
                "nees": _mean(one["nees"]),
                "speed_nees": _mean(one["speed_nees"]),
            }
        )
    shown = {pair["true_id"] for pair in pairs}
    together = {
        name: np.concatenate([one[name] for one in errors]) if errors else np.zeros(0)
        for name in ("position", "motion", "speed", "nees", "speed_nees")
    }
    return {
        "truth": len(truth),
        "found": len(shown),
        "missed": len(truth) - len(shown),
        "split": len(pairs) - len(shown),
        "invented": len(results.tracks) - len(pairs),
        "position_median": _median(together["position"]),
        "motion_median": _median(together["motion"]),
        "speed_median": _median(together["speed"]),
        "nees_mean": _mean(together["nees"]),
        "speed_nees_mean": _mean(together["speed_nees"]),
        "pairs": pairs,
    }


def _common(
    track: Track, timestamps: Floats, thing: TrueTrack, tolerance: float
) -> tuple[Ints, Ints]:
    """Return the rows of a track that have a true one near in time, and the true ones."""
    times = timestamps[track.pose]
    after = np.searchsorted(thing.timestamps, times).clip(max=len(thing.timestamps) - 1)
    before = (after - 1).clip(min=0)
    is_nearer = np.abs(thing.timestamps[before] - times) < np.abs(thing.timestamps[after] - times)
    nearest = np.where(is_nearer, before, after)
    rows = np.flatnonzero(np.abs(thing.timestamps[nearest] - times) <= tolerance)
    return rows, nearest[rows]


def _nearest(
    track: Track,
    timestamps: Floats,
    truth: Sequence[TrueTrack],
    alignment: Alignment,
    tolerance: float,
) -> tuple[TrueTrack, float] | None:
    """Return the thing that a track is nearest to in the median, and how far that is [m].

    Only those that are known at half of the times of the track, or more, are compared.
    """
    centers, found = alignment.apply(track.centers), None
    for thing in truth:
        rows, true_rows = _common(track, timestamps, thing, tolerance)
        if 2 * len(rows) < len(track) or not rows.size:
            continue
        away = np.linalg.norm(centers[rows] - thing.centers[true_rows], axis=1)
        if found is None or np.median(away) < found[1]:
            found = thing, float(np.median(away))
    return found


def _errors(
    track: Track, rows: Ints, thing: TrueTrack, true_rows: Ints, alignment: Alignment
) -> dict[str, Floats]:
    """Return the errors of some images of a track."""
    off = alignment.apply(track.centers[rows]) - thing.centers[true_rows]
    turn = alignment.scale * alignment.rotation
    spread = turn @ track.center_covariances[rows] @ turn.T
    steps = np.diff(track.pose[rows]) == 1
    speed = alignment.scale * np.abs(track.speeds[rows]) - thing.speeds[true_rows]
    known = np.isfinite(speed)
    sigma = alignment.scale * track.speed_sigmas[rows][known]
    return {
        "position": np.linalg.norm(off, axis=1),
        "motion": np.linalg.norm(np.diff(off, axis=0)[steps], axis=1),
        "speed": np.abs(speed[known]),
        "nees": normalized_squares(off, spread),
        "speed_nees": (speed[known] / sigma) ** 2,
    }


def _median(values: Floats) -> float | None:
    return float(np.median(values)) if len(values) else None


def _mean(values: Floats) -> float | None:
    return float(np.mean(values)) if len(values) else None
