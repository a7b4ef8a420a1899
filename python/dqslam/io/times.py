"""Times in cells of files: seconds, or whole milli-, micro- or nanoseconds since 1970."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

from dqslam._checks import Floats
from dqslam.io.files import parse_floats
from dqslam.io.notes import Notes

# Digits before the point of a time since 1970, from 2001 to 2286, and its unit.
SINCE_1970 = {13: ("milliseconds", 10**3), 16: ("microseconds", 10**6), 19: ("nanoseconds", 10**9)}


def parse_times(
    path: str | Path,
    name: str,
    cells: Sequence[str],
    lines: Sequence[int],
    notes: Notes,
    divisor: int | None = None,
) -> Floats:
    """Turn the cells of a column into seconds, shape (n,), NaN among them.

    ``divisor`` is the number of units in a second, if the file says it. If not, times whose
    digits only fit a smaller unit are converted, which is noted.
    """
    if divisor is None:
        digits = {len(cell.partition(".")[0]) for cell in cells if cell[:1].isdigit()}
        unit, divisor = SINCE_1970.get(digits.pop(), ("", 1)) if len(digits) == 1 else ("", 1)
        if unit:
            notes.doubt(path, f"{name} has the digits of {unit} since 1970 and is read as these")
    if divisor == 1:
        return parse_floats(path, name, cells, lines)
    # A float of nanoseconds would lose 7 bits before it is divided.
    return parse_floats(path, name, [_divided(cell, divisor) for cell in cells], lines)


def _divided(cell: str, divisor: int) -> str:
    try:
        value = Decimal(cell)
    except InvalidOperation:
        return cell  # its error names it as it is
    return repr(float(value / divisor)) if value.is_finite() else "nan"
