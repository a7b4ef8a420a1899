"""Assign boxes of one image to objects: each box to one object at most, each object one box."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats, Ints

# Stands for infinity, which the solver of the assignment refuses when nothing else is left.
_FORBIDDEN = 1e9


def assign(cost: Floats, null: Floats) -> tuple[Ints, Floats]:
    """Choose the assignment of least total cost, and return how sure each of its pairs is.

    Parameters
    ----------
    cost
        Of box i showing object j, shape (b, p); infinite where it cannot.
    null
        Of box i showing nothing of the map, shape (b,).

    Returns
    -------
    column
        Object of each box, -1 for none, shape (b,).
    margin
        By how much the total cost rises when that choice for the box is forbidden, shape (b,): the
        joint ambiguity, all other boxes choosing anew.
    """
    from scipy.optimize import linear_sum_assignment

    boxes, objects = cost.shape
    column = np.full(boxes, -1)
    margin = np.full(boxes, np.inf)
    if not boxes or not objects:
        return column, margin
    table = np.full((boxes, objects + boxes), _FORBIDDEN)
    table[:, :objects] = np.where(np.isfinite(cost), cost, _FORBIDDEN)
    table[range(boxes), range(objects, objects + boxes)] = null
    rows, chosen = linear_sum_assignment(table)
    total = table[rows, chosen].sum()
    column = np.where(chosen < objects, chosen, -1)
    for row in range(boxes):
        rivals = np.isfinite(cost[row]).sum()
        if column[row] < 0 and not rivals:
            continue
        if column[row] >= 0 and rivals + np.isfinite(cost[:, column[row]]).sum() == 2:
            margin[row] = null[row] - cost[row, column[row]]  # nobody else is concerned
            continue
        other = table.copy()
        other[row, chosen[row]] = _FORBIDDEN
        margin[row] = other[linear_sum_assignment(other)].sum() - total
    return column.astype(np.int64), margin
