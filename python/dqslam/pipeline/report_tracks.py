"""What a report says about what moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.recording import Detections
from dqslam.track import Track
from dqslam.tracks import Tracked


def describe_tracks(
    tracked: Tracked | None, detections: Detections, timestamps: Floats
) -> dict[str, Any] | None:
    """Describe what moves, and boxes of what rests or is unknown; None where none was looked for.

    ``detections`` are those that the estimator was given, ``timestamps`` (n,) those of all poses.
    """
    if tracked is None:
        return None

    def what(rows: Ints) -> dict[str, Any]:
        classes, counts = np.unique(detections.class_id[rows], return_counts=True)
        times = timestamps[detections.pose[rows]]
        return {
            "class_name": detections.class_names[int(classes[np.argmax(counts)])],
            "boxes": len(rows),
            "first_s": float(times.min()),
            "last_s": float(times.max()),
        }

    return {
        "ground": {
            "kind": tracked.ground.kind,
            "height_m": tracked.ground.height_m,
            "height_sigma_m": tracked.ground.common_sigma_m,
            "scatter_m": tracked.ground.sigma_m,
            "slope_sigma": tracked.ground.slope_sigma,
            "shown_by": tracked.ground.feet,
        },
        "moving": [describe_track(track, timestamps) for track in tracked.tracks],
        "resting": [what(rows) for rows in tracked.resting],
        "unknown": [what(rows) | {"reason": why} for rows, why in tracked.unknown],
    }


def describe_track(track: Track, timestamps: Floats) -> dict[str, Any]:
    """Summarize a track; ``timestamps`` (n,) are those of all poses."""
    times = timestamps[track.pose]
    run = np.linalg.norm(np.diff(track.centers, axis=0), axis=1).sum()
    return {
        "id": track.track_id,
        "class_name": track.class_name,
        "behavior": track.behavior,
        "probability": track.probability,
        "images": len(track),
        "first_s": float(times[0]),
        "last_s": float(times[-1]),
        "length_of_path_m": float(run),
        "speed_median_m_s": float(np.median(track.speeds)),
        "speed_sigma_m_s": float(np.median(track.speed_sigmas)),
        "center_sigma_m": float(
            np.sqrt(np.median(np.trace(track.center_covariances, axis1=1, axis2=2)))
        ),
        "sides_m": track.sides.tolist(),
    }
