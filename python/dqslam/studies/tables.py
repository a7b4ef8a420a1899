"""One table as CSV, and as Parquet if pyarrow is installed."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dqslam._files import whole_file, write_text


def write_table(
    stem: Path,
    columns: Mapping[str, Sequence[Any]],
    types: Mapping[str, type] | None = None,
) -> list[Path]:
    """Write columns of equal length as ``stem.csv`` and ``stem.parquet``, and return the files.

    Parameters
    ----------
    columns
        Texts, numbers, or None for an empty cell, by the names of the columns.
    types
        ``str``, ``int`` or ``float`` by the names of columns, so that a column of empty cells has
        the type of a full one. The types of other columns are those of their values.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    path = stem.with_suffix(".csv")
    write_text(path, text.getvalue())
    if find_spec("pyarrow") is None:
        return [path]
    return [path, _write_parquet(stem.with_suffix(".parquet"), columns, types or {})]


def _write_parquet(
    path: Path, columns: Mapping[str, Sequence[Any]], types: Mapping[str, type]
) -> Path:
    import pyarrow
    from pyarrow import parquet

    stored = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    arrays = {
        name: pyarrow.array(values, stored[types[name]] if name in types else None)
        for name, values in columns.items()
    }
    with whole_file(path) as temporary:
        parquet.write_table(pyarrow.table(arrays), temporary)
    return path
