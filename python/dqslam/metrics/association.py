"""How well boxes were told apart: which object each was taken for, against the truth."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Ints, as_ints


@dataclass(frozen=True)
class AssociationScore:
    """Boxes and objects, right and wrong."""

    boxes: int
    """Boxes that were judged."""
    precision: float
    """Of pairs of boxes taken for one object, the share that show one; NaN without such pairs."""
    recall: float
    """Of pairs of boxes that show one object, the share taken for one; NaN without such pairs."""
    purity: float
    """Share of the boxes taken for an object that show what most of that object's boxes show."""
    id_switches: int
    """Along the boxes of a true object in time, how often the object they are taken for changes."""
    found: int
    """True objects that some object consists of, for the most part."""
    missed: int
    """True objects that none does."""
    split: int
    """Objects beyond the first of the same true object."""
    invented: int
    """Objects that consist of boxes of nothing, for the most part."""


def score_association(pose: Ints, object_id: Ints, true_id: Ints) -> AssociationScore:
    """Judge which object each box was taken for.

    Parameters
    ----------
    pose
        Row of the pose that saw the box, rising with time; shape (m,).
    object_id
        What the box was taken for, -1 for nothing; shape (m,).
    true_id
        What it shows, -1 for nothing (a false positive); shape (m,).
    """
    object_id = as_ints("object_id", object_id)
    true_id = as_ints("true_id", true_id, len(object_id))
    pose = as_ints("pose", pose, len(object_id))
    taken, true = object_id >= 0, true_id >= 0
    counts = _contingency(object_id[taken & true], true_id[taken & true])
    together = _pairs(counts)
    precision = _ratio(together, _pairs(np.unique(object_id[taken], return_counts=True)[1]))
    recall = _ratio(together, _pairs(np.unique(true_id[true], return_counts=True)[1]))
    mostly, most = _majorities(object_id[taken], true_id[taken])
    found = np.unique(mostly[mostly >= 0])
    return AssociationScore(
        boxes=len(object_id),
        precision=precision,
        recall=recall,
        purity=_ratio(float(most.sum()), float(taken.sum())),
        id_switches=_switches(pose, object_id, true_id),
        found=len(found),
        missed=len(np.unique(true_id[true])) - len(found),
        split=int((mostly >= 0).sum()) - len(found),
        invented=int((mostly < 0).sum()),
    )


def _pairs(counts: Ints) -> float:
    """Count the pairs within groups of these sizes."""
    counts = counts.astype(np.float64)
    return float(np.sum(counts * (counts - 1.0) / 2.0))


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def _contingency(object_id: Ints, true_id: Ints) -> Ints:
    """Count the boxes of each pair of ids that occurs."""
    return np.unique(np.column_stack([object_id, true_id]), axis=0, return_counts=True)[1]


def _majorities(object_id: Ints, true_id: Ints) -> tuple[Ints, Ints]:
    """Return, for each object, what most of its boxes show (-1: nothing), and how many do.

    Of equals it is the lowest id that shows something.
    """
    shown, most = [], []
    for one in np.unique(object_id):
        values, counts = np.unique(true_id[object_id == one], return_counts=True)
        order = np.lexsort((values, values < 0, -counts))
        shown.append(values[order[0]])
        most.append(counts[order[0]])
    return np.array(shown, dtype=np.int64), np.array(most, dtype=np.int64)


def _switches(pose: Ints, object_id: Ints, true_id: Ints) -> int:
    count = 0
    for one in np.unique(true_id[true_id >= 0]):
        rows = np.flatnonzero((true_id == one) & (object_id >= 0))
        taken_for = object_id[rows[np.argsort(pose[rows], kind="stable")]]
        count += int(np.sum(taken_for[1:] != taken_for[:-1]))
    return count
