"""Other classes that a box may be of: columns ``class_id_2``, ``class_name_2``, ``score_2``, ...

The first class of a box is that of the columns ``class_id``, ``class_name`` and ``score``; the next
has a 2 at the end, the one after it a 3. A box with fewer possible classes has empty cells.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.io.files import FileError
from dqslam.io.labels import NO_LABEL, is_none

NUMBERED = ("class_id", "class_name", "score")  #: columns that a number may follow


@dataclass(frozen=True, eq=False)
class ClassColumn:
    """One more class of each box, as a file has it."""

    number: str  #: at the end of the names of its columns
    score: Floats  #: confidence, NaN where there is none, shape (m,)
    class_id: Sequence[str] | None = None
    class_name: Sequence[str] | None = None

    def has_class(self, row: int) -> bool:
        """Return whether a box has this class."""
        given = (self.class_id, self.class_name)
        return any(one is not None and not is_none(one[row]) for one in given)


@dataclass(frozen=True, eq=False)
class OtherClasses:
    """Other classes of boxes, k of them each."""

    class_id: Ints  #: -1 for none, shape (m, k)
    score: Floats  #: confidence, 0 for none, shape (m, k)
    class_names: Mapping[int, str]

    def select(self, rows: Ints | Bools) -> OtherClasses:
        """Return those of some boxes."""
        return replace(self, class_id=self.class_id[rows], score=self.score[rows])


def class_columns(
    path: str | Path,
    columns: Mapping[str, str],
    labels: Callable[[str], Sequence[str] | None],
    scores: Callable[[str], Floats],
    line: int | None = None,
) -> tuple[ClassColumn, ...]:
    """Return the other classes that a file has columns of, the likeliest first.

    Parameters
    ----------
    columns
        Names in the file by their meanings, such as ``class_id_2``.
    labels, scores
        Return a column by its meaning, as texts or as numbers.
    line
        That of the header.

    Raises
    ------
    FileError
        If a class has no score, or a score no class.
    """
    meanings = [name.rsplit("_", 1) for name in columns]
    numbers = {one[1] for one in meanings if one[0] in NUMBERED and one[-1].isdigit()}
    found = []
    for number in sorted(numbers, key=int):
        class_id, class_name = labels(f"class_id_{number}"), labels(f"class_name_{number}")
        named = class_id is not None or class_name is not None
        if not named or f"score_{number}" not in columns:
            has, lacks = (
                (f"class {number}", f"score_{number}")
                if named
                else (f"score_{number}", f"class_id_{number} or class_name_{number}")
            )
            raise FileError(path, f"{has} needs a column {lacks}", line)
        score = scores(f"score_{number}")
        found.append(ClassColumn(number, score, class_id=class_id, class_name=class_name))
    return tuple(found)


def joined_labels(
    path: str | Path,
    ids: Sequence[str] | None,
    names: Sequence[str] | None,
    others: Sequence[ClassColumn],
) -> tuple[list[str] | None, list[str] | None]:
    """Return ids and names of classes of all boxes, then of the first other classes, and so on.

    What a column of others lacks is looked up in the rows of the first classes, which have both.

    Raises
    ------
    FileError
        If other classes are named by what the first ones lack.
    """
    name_of: dict[str, str] = {}
    if ids is not None and names is not None:
        name_of = dict(zip(ids, names, strict=True))
    id_of = {name: number for number, name in name_of.items()}
    all_ids, all_names = list(ids or ()), list(names or ())
    for one in others:
        for first, own, lack in ((ids, one.class_id, "id"), (names, one.class_name, "name")):
            if first is None and own is not None:
                message = f"column class_{lack}_{one.number} needs a column class_{lack}"
                raise FileError(path, message)
        one_ids, one_names = one.class_id, one.class_name
        if one_ids is None:
            one_ids = [id_of.get(name, name) for name in one_names or ()]
        if one_names is None:
            one_names = [name_of.get(number, "") for number in one_ids]
        all_ids += one_ids
        all_names += one_names
    return None if ids is None else all_ids, None if names is None else all_names


def other_classes(
    columns: Sequence[ClassColumn],
    class_id: Ints,
    class_name: Sequence[str],
    error: Callable[[int, str], FileError],
) -> OtherClasses | None:
    """Make a table of other classes from the numbers and names of all, in joined order.

    Raises
    ------
    FileError
        If a class has no score from 0 to 1, or is that of the box again.
    """
    if not columns:
        return None
    count = len(class_id) // (len(columns) + 1)
    numbers = class_id.reshape(-1, count).T
    there = np.array([[one.has_class(row) for one in columns] for row in range(count)])
    others = np.where(there, numbers[:, 1:], NO_LABEL)
    score = np.column_stack([one.score for one in columns])
    score = np.where(there, score, 0.0)
    for row, column in np.argwhere(~((score >= 0) & (score <= 1))).tolist():
        value = score[row, column]
        what = "empty" if np.isnan(value) else f"{value:g}, not between 0 and 1"
        raise error(row, f"score_{columns[column].number} is {what}")
    for row, column in np.argwhere(there & (others == numbers[:, :1])).tolist():
        name = class_name[row]
        raise error(row, f"class {columns[column].number} is that of the box again, {name}")
    names = dict(zip(others.T.ravel().tolist(), class_name[count:], strict=True))
    names.pop(NO_LABEL, None)
    return OtherClasses(others, score, names)
