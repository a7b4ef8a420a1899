"""The quality of an association: the object that each box was assigned to, against the truth."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Ints, as_ints


@dataclass(frozen=True)
class AssociationScore:
    """Numbers of right and wrong boxes and objects."""

    boxes: int
    """Number of boxes that were compared."""
    precision: float
    """Share of the pairs of boxes assigned to one object that show one; NaN without such pairs."""
    recall: float
    """Share of the pairs of boxes that show one object which are assigned to one; else NaN."""
    purity: float
    """Share of the assigned boxes that show the same as most boxes of their object."""
    id_switches: int
    """Number of changes of the assigned object along the boxes of a true object in time."""
    found: int
    """Number of true objects that are shown by most boxes of some object."""
    missed: int
    """Number of true objects that were not found."""
    split: int
    """Number of objects in excess of one for the same true object."""
    invented: int
    """Number of objects of which most boxes show nothing."""


def score_association(pose: Ints, object_id: Ints, true_id: Ints) -> AssociationScore:
    """Compare the object of each box with the truth.

    Parameters
    ----------
    pose
        Row of the pose from which the box was observed, ascending in time, shape (m,).
    object_id
        The object that the box was assigned to, -1 for none, shape (m,).
    true_id
        The true object that the box shows, -1 for none (a false positive), shape (m,).
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
    """Return the true object that most boxes of each object show (-1 for none), and their number.

    If several are equal, it is the lowest id of a true object.
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
