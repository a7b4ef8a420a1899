"""Whether a map is torn where the odometry jumps: the same objects twice, before and after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.places import CannotTellError, Landmarks, align


def doubt_torn(landmarks: Landmarks, times: Floats, object_id: Ints, jumps: Floats) -> list[str]:
    """Return a sentence on each jump across which objects of a map are there twice.

    Between two jumps, poses are known relative to each other. Where no object is seen before a jump
    and after it, but those before are like those after it, moved by one motion, they are the same.
    Where that would happen by chance as well, nothing is said.

    Parameters
    ----------
    landmarks
        The objects of the map.
    times, object_id
        Of the boxes: their times (m,) s, and the ids of the objects that they show, (m,).
    jumps
        Times of the last poses before the odometry jumps, (j,) s, increasing.
    """
    if not jumps.size or len(landmarks) < 2:
        return []
    part = np.searchsorted(jumps, times, side="left")
    seen = [
        np.isin(landmarks.object_ids, object_id[part == number]) for number in range(len(jumps) + 1)
    ]
    doubts = []
    for time, before, after in zip(jumps.tolist(), seen[:-1], seen[1:], strict=True):
        if not (before.any() and after.any()) or (before & after).any():
            continue
        try:
            found = align(_chosen(landmarks, before), _chosen(landmarks, after))
        except CannotTellError:
            continue
        centers = landmarks.centers[np.isin(landmarks.object_ids, found.a_ids)]
        there = centers @ found.b_from_a[:3, :3].T + found.b_from_a[:3, 3]
        moved = float(np.linalg.norm(there - centers, axis=1).mean())
        doubts.append(
            f"the odometry jumps at {time:.6g} s, and {len(found)} objects are in the map twice, "
            f"once from before it and once from after it, {moved:.3g} m away: estimate the parts "
            "of the recording alone (--force), and join their maps by `dqslam merge`"
        )
    return doubts


def _chosen(landmarks: Landmarks, rows: Bools) -> Landmarks:
    """Return some objects of a map."""
    columns = {name: part for name, part in vars(landmarks).items() if isinstance(part, np.ndarray)}
    names = tuple(np.array(landmarks.class_names, dtype=object)[rows])
    return replace(
        landmarks, class_names=names, **{name: part[rows] for name, part in columns.items()}
    )
