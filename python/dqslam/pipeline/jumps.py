"""Whether a map is torn where the odometry jumps: the same objects twice, before and after it.

Two signs tell it. Where images go on without a gap, most boxes hardly move from the last image
before the jump to the first one after it, and a pair that overlaps shows one thing. Beyond a gap,
the objects of both sides are compared by where they are relative to each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.io.span import seconds
from dqslam.metrics import match_boxes
from dqslam.places import CannotTellError, Landmarks, align
from dqslam.recording import Detections

GAP = 3.0  #: median intervals of poses, beyond which boxes that overlap may be of other things
SAME_IOU = 0.5  #: intersection over union of boxes that show the same thing in successive images
FEWEST_PARTED = 2


def doubt_jumps(
    landmarks: Landmarks, boxes: Detections, timestamps: Floats, jumps: Floats
) -> list[str]:
    """Return a sentence on each jump across which a map is torn.

    Parameters
    ----------
    landmarks
        The objects of the map.
    boxes
        With the ids of the objects that they show.
    timestamps
        Times of the poses (n,), s.
    jumps
        Times of the last poses before the odometry jumps, (j,) s, increasing.
    """
    by_boxes = {time: told for time in jumps if (told := _doubt_parted(boxes, timestamps, time))}
    others = np.array([time for time in jumps if time not in by_boxes])
    times = timestamps[boxes.pose]
    return [*by_boxes.values(), *doubt_torn(landmarks, times, boxes.object_id, others)]


def _doubt_parted(boxes: Detections, timestamps: Floats, jump: float) -> str | None:
    """Return a sentence if boxes that go on in the images change their objects at a jump."""
    times = timestamps[boxes.pose]
    before, after = times <= jump, times > jump
    if not (before.any() and after.any()):
        return None
    last, first = float(times[before].max()), float(times[after].min())
    if first - last > GAP * np.median(np.diff(timestamps)):
        return None
    one = np.flatnonzero((times == last) & (boxes.object_id >= 0))
    other = np.flatnonzero((times == first) & (boxes.object_id >= 0))
    image = np.zeros(len(one) + len(other), dtype=np.int64)
    same = match_boxes(
        image[: len(one)], boxes.box[one], image[len(one) :], boxes.box[other], min_iou=SAME_IOU
    )
    one, other = one[same >= 0], other[same[same >= 0]]
    alike = boxes.class_id[one] == boxes.class_id[other]
    parted = int(np.sum(boxes.object_id[one][alike] != boxes.object_id[other][alike]))
    if parted < FEWEST_PARTED or parted <= alike.sum() / 2:
        return None
    return (
        f"the odometry jumps at {seconds(jump)} s, and {parted} of {alike.sum()} boxes that hardly "
        "move in the images then are of another object afterwards: the map has objects twice. "
        f"{_remedy(jump, first)}"
    )


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
        x, y, z = found.b_from_a[:3, 3].tolist()
        trace = float(np.trace(found.b_from_a[:3, :3]))
        turn = float(np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))))
        moved = float(np.linalg.norm(there - centers, axis=1).mean())
        doubts.append(
            f"the odometry jumps at {seconds(time)} s, and {len(found)} objects are in the map "
            f"twice, once from before it and once from after it, {moved:.3g} m away: all that "
            f"comes later is turned by {turn:.3g} deg and moved by {x:.3g} {y:.3g} {z:.3g} m. "
            f"{_remedy(time, float(times[times > time].min()))}"
        )
    return doubts


def _remedy(last: float, first: float) -> str:
    """Say how the parts are estimated alone, from the times of their last and first images."""
    return (
        f"Estimate the parts alone, with --until {seconds(last)} and with --from {seconds(first)}, "
        "and join their maps by `dqslam merge`"
    )


def _chosen(landmarks: Landmarks, rows: Bools) -> Landmarks:
    """Return some objects of a map."""
    return replace(
        landmarks,
        object_ids=landmarks.object_ids[rows],
        class_names=tuple(np.array(landmarks.class_names, dtype=object)[rows]),
        centers=landmarks.centers[rows],
        covariances=landmarks.covariances[rows],
        semi_axes=landmarks.semi_axes[rows],
        log_semi_axes_sigmas=landmarks.log_semi_axes_sigmas[rows],
        orientations=landmarks.orientations[rows],
        observations=landmarks.observations[rows],
    )
