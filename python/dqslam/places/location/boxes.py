"""The boxes of an image, with all the labels that a detector gives each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints, as_floats, reject_rows
from dqslam.recording import Detections

# Boxes of different classes that overlap by this are one box with several labels.
SAME_BOX_IOU = 0.8


@dataclass(frozen=True, eq=False)
class LabeledBoxes:
    """The boxes of one image."""

    row: Ints
    """Row of each box among all detections, shape (b,); that of the best label of several."""
    box: Floats
    """Undistorted pixels, shape (b, 4)."""
    score: Floats
    """Confidence of the detector, shape (b,)."""
    truncated: Bools
    """Shape (b, 4)."""
    labels: list[Mapping[str, float]]
    """The weight of each label of each box."""


def label_boxes(
    detections: Detections, pose: int, labels: Sequence[Mapping[str, float]] | None
) -> LabeledBoxes:
    """Take the boxes of the image at a pose, and join those that are one with several labels.

    ``labels`` (m,) are the weights of labels of all detections; by default, the class of each and
    the other classes that the detector thinks possible, by their confidences.
    """
    rows = np.flatnonzero(detections.pose == pose)
    rows = rows[np.argsort(-detections.score[rows], kind="stable")]
    kept: list[int] = []
    found: list[dict[str, float]] = []
    for row in rows.tolist():
        own = _labels(detections, row) if labels is None else dict(labels[row])
        same = _iou(detections.box[kept], detections.box[row]) >= SAME_BOX_IOU
        other = detections.class_id[kept] != detections.class_id[row]
        if (same & other).any():
            joined = found[int(np.argmax(same & other))]
            for name, weight in own.items():
                joined[name] = joined.get(name, 0.0) + weight
        else:
            kept.append(row)
            found.append(own)
    order = np.argsort(kept)
    chosen = np.array(kept, dtype=np.int64)[order]
    return LabeledBoxes(
        row=chosen,
        box=detections.box[chosen],
        score=detections.score[chosen],
        truncated=detections.truncated[chosen],
        labels=[found[place] for place in order.tolist()],
    )


def labels_of_array(
    labels: Sequence[Mapping[str, float]] | Floats, detections: Detections
) -> Sequence[Mapping[str, float]]:
    """Return labels that are a table of probabilities as names with weights; others as they are.

    Raises
    ------
    ValueError
        If a table is not of shape (m, c), with a column for each class.
    """
    if not isinstance(labels, np.ndarray):
        return labels
    names = [detections.class_names[number] for number in sorted(detections.class_names)]
    table = as_floats("labels", labels, [len(detections), len(names)])
    reject_rows("labels", table < 0.0, "negative", table)
    reject_rows("labels", table.max(axis=1, initial=0.0) <= 0.0, "no class is possible", table)
    return [
        {names[column]: float(row[column]) for column in np.flatnonzero(row).tolist()}
        for row in table
    ]


def check_labels(labels: Sequence[Mapping[str, float]], count: int) -> None:
    """Refuse labels that are not a positive weight of at least one name for each box.

    Raises
    ------
    ValueError
        If so, with the row.
    """
    if len(labels) != count:
        raise ValueError(f"labels: expected {count} rows, one per box, got {len(labels)}")
    for row, names in enumerate(labels):
        weights = np.array(list(names.values()), dtype=np.float64)
        if not weights.size or not np.isfinite(weights).all() or weights.min() < 0.0:
            raise ValueError(f"labels row {row}: not weights of names: {dict(names)}")
        if not weights.sum() > 0.0:
            raise ValueError(f"labels row {row}: the weights sum to 0")


def _labels(detections: Detections, row: int) -> dict[str, float]:
    """Return the confidences of the detector in the class of a box and in its other classes."""
    name = detections.class_names[int(detections.class_id[row])]
    found = {name: max(float(detections.score[row]), 1e-3)}
    others = detections.other_class_id[row].tolist(), detections.other_score[row].tolist()
    for number, score in zip(*others, strict=True):
        if number >= 0 and score > 0.0:
            other = detections.class_names[number]
            found[other] = found.get(other, 0.0) + score
    return found


def _iou(boxes: Floats, box: Floats) -> Floats:
    """Return the intersection over union of boxes (k, 4) with one (4,), shape (k,)."""
    low, high = np.maximum(boxes[:, :2], box[:2]), np.minimum(boxes[:, 2:], box[2:])
    common = np.maximum(high - low, 0.0).prod(axis=1)
    area = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(common / (area + (box[2:] - box[:2]).prod() - common))
