"""CSV with a header, also with ; or tabs: columns are found by name, in any order.

# starts a comment line.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.io.files import FileError, parse_integers, parse_numbers, read_rows


@dataclass(frozen=True, eq=False)
class CsvTable:
    """Cells as text, and conversions whose errors name the line."""

    path: str
    columns: Mapping[str, tuple[str, ...]]
    """Cells of each column, stripped."""
    lines: tuple[int, ...]
    """Number of the line in the file, from 1, of each row."""
    header: int
    """Number of the line of the header."""

    def __len__(self) -> int:
        """Return the number of rows below the header."""
        return len(self.lines)

    def __contains__(self, name: str) -> bool:
        """Return whether there is a column with this name."""
        return name in self.columns

    def cells(self, name: str) -> tuple[str, ...]:
        """Return a column as text."""
        return self.columns[name]

    def numbers(self, name: str) -> Floats:
        """Return a column as finite numbers, shape (n,)."""
        return parse_numbers(self.path, name, self.columns[name], self.lines)

    def integers(self, name: str, *, empty: str = "") -> Ints:
        """Return a column as whole numbers, shape (n,); an empty cell stands for ``empty``."""
        cells = [cell or empty for cell in self.columns[name]]
        return parse_integers(self.path, name, cells, self.lines)

    def flags(self, name: str) -> Bools:
        """Return a column of 0 and 1, shape (n,)."""
        values = self.integers(name)
        self.reject((values != 0) & (values != 1), f"{name} is {{}}, not 0 or 1", name)
        return values.astype(np.bool_)

    def reject(self, bad: Bools, message: str, name: str | None = None) -> None:
        """Raise for the first bad row (n,); {} in the message is its cell of a column."""
        rows = np.flatnonzero(bad)
        if rows.size:
            cell = "" if name is None else self.columns[name][rows[0]]
            raise FileError(self.path, message.format(cell), self.lines[rows[0]])


def delimiter_of(header: str) -> str:
    """Return what separates the columns of a header: a comma, or else a semicolon or a tab."""
    return next((one for one in (",", ";", "\t") if one in header), ",")


def read_csv(
    path: str | Path, *, required: Sequence[str] = (), allow_empty: bool = False
) -> CsvTable:
    """Read a table that has the required columns and, by default, at least one row."""
    rows, lines = read_rows(path)
    try:
        header, *records = csv.reader(rows, strict=True, delimiter=delimiter_of(rows[0]))
    except csv.Error as error:
        raise FileError(path, f"not CSV: {error}") from None
    names = [name.strip() for name in header]
    missing = [name for name in required if name not in names]
    if missing:
        message = f"no column {', '.join(missing)} (it has: {', '.join(names)})"
        raise FileError(path, message, lines[0])
    name, most = Counter(names).most_common(1)[0]
    if most > 1:
        raise FileError(path, f"{most} columns are named {name}", lines[0])
    if len(records) != len(rows) - 1:
        raise FileError(path, "not CSV: a quoted field runs over the end of its line")
    if not records and not allow_empty:
        raise FileError(path, "holds no rows, only a header")
    for record, line in zip(records, lines[1:], strict=True):
        if len(record) != len(names):
            raise FileError(path, f"{len(record)} fields, but {len(names)} columns", line)
    columns = {
        name: tuple(record[column].strip() for record in records)
        for column, name in enumerate(names)
    }
    return CsvTable(str(path), columns, tuple(lines[1:]), lines[0])
