"""Ids and classes are names; in arrays they are whole numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

NO_LABEL = -1
NONE = frozenset(("", "-1", "-1.0", "nan", "none", "null", "na", "<na>"))  #: in lower case
# Beyond 2^53, different integers have the same float, and programs that write ids as floats have
# lost their digits. Such ids are names.
LARGEST = 2**53


class LabelError(ValueError):
    """A label that is a number, but not a whole one."""

    def __init__(self, row: int, label: str) -> None:
        super().__init__(f"{label!r} is not a whole number")
        self.row, self.label = row, label


def is_none(label: str) -> bool:
    """Return whether a label stands for none."""
    return label.strip().lower() in NONE


def numbered(labels: Sequence[str], *, by_name: bool = False) -> NDArray[np.int64]:
    """Turn labels into whole numbers, shape (n,), -1 for none.

    If all labels are whole numbers from 0 below 2^53, these are the numbers ("5.0" is 5). Otherwise
    labels are names (words, UUIDs, longer numbers): each gets its place in the order in which they
    occur, or, ``by_name``, in the order of names.

    Raises
    ------
    LabelError
        For a label such as 3.5: it is neither a name nor a whole number.
    """
    cells = [label.strip() for label in labels]
    distinct = [label for label in dict.fromkeys(cells) if not is_none(label)]
    values = {label: _whole(label) for label in distinct}
    for label in distinct:
        if values[label] is None and _is_fraction(label):
            raise LabelError(cells.index(label), label)
    if any(value is None for value in values.values()):
        order = sorted(distinct) if by_name else distinct
        values = {label: number for number, label in enumerate(order)}
    return np.array([values.get(label, NO_LABEL) for label in cells], dtype=np.int64)


def _whole(label: str) -> int | None:
    """Return the value of a whole number from 0 below 2^53, or None."""
    if not label.isascii():
        return None
    if label.isdigit():
        return int(label) if len(label) <= 16 and int(label) < LARGEST else None
    try:
        value = float(label)
    except ValueError:
        return None
    return int(value) if 0 <= value < LARGEST and value == math.floor(value) else None


def _is_fraction(label: str) -> bool:
    """Return whether a label is a number with a point or an exponent that is not whole."""
    if not any(sign in label for sign in ".eE"):
        return False
    try:
        float(label)
    except ValueError:
        return False
    # 1e5 and 12e4567 may be parts of hexadecimal names.
    return "." in label or "e+" in label.lower() or "e-" in label.lower()
