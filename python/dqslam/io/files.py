"""Rows, numbers, folders and JSON, with errors that name file and line.

Files are written completely or not at all.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam._exchange import new_stage, release, remove_stale_stages
from dqslam._files import FileError as FileError
from dqslam._files import refuse_inputs as refuse_inputs
from dqslam._files import write_text as write_text
from dqslam._input import plain_name
from dqslam._input import read_text as read_text
from dqslam._limits import IN_REACH, LARGEST_NUMBER


def read_rows(path: str | Path) -> tuple[list[str], list[int]]:
    """Read the lines that are neither blank nor comments (#), and their numbers from 1."""
    numbered = [
        (line, number)
        for number, line in enumerate(read_text(path).split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise FileError(path, "holds nothing but comments")
    return [line for line, _ in numbered], [number for _, number in numbered]


def text_files(folder: Path) -> list[Path]:
    """Return the files ``*.txt`` and ``*.txt.gz`` of a folder, in the order of their names.

    Raises
    ------
    FileError
        If one is there twice, packed and not.
    """
    files = sorted([*folder.glob("*.txt"), *folder.glob("*.txt.gz")], key=plain_name)
    for one, other in pairwise(files):
        if plain_name(one) == plain_name(other):
            raise FileError(folder, f"has both {one.name} and {other.name}")
    return files


def parse_numbers(
    path: str | Path, name: str, cells: Sequence[str], lines: Sequence[int]
) -> NDArray[np.float64]:
    """Turn the cells of one column into finite numbers, shape (n,)."""
    values = parse_floats(path, name, cells, lines)
    bad = np.flatnonzero(np.isnan(values))
    if bad.size:
        raise FileError(path, f"{name} is {cells[bad[0]].strip()}, not {IN_REACH}", lines[bad[0]])
    return values


def parse_floats(
    path: str | Path, name: str, cells: Sequence[str], lines: Sequence[int]
) -> NDArray[np.float64]:
    """Turn the cells of one column into numbers, shape (n,), NaN where one is not in reach."""
    try:
        return in_reach(np.array(list(map(float, cells)), dtype=float))
    except ValueError:
        _blame_cell(path, name, cells, lines)
        raise


def in_reach(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return numbers, NaN where one is infinite or so large that no unit makes sense of it.

    With what is left, no sum of squares and no polynomial of a lens overflows.
    """
    return np.where(np.abs(values) <= LARGEST_NUMBER, values, np.nan)


def parse_integers(
    path: str | Path, name: str, cells: Sequence[str], lines: Sequence[int]
) -> NDArray[np.int64]:
    """Turn the cells of one column into whole numbers, shape (n,); "5.0" is one."""
    values = parse_numbers(path, name, cells, lines)
    # Beyond 2^53, different integers have the same float.
    bad = np.flatnonzero((values != np.floor(values)) | (np.abs(values) >= 2.0**53))
    if bad.size:
        raise FileError(
            path, f"{name} is {cells[bad[0]].strip()}, not a whole number", lines[bad[0]]
        )
    return values.astype(np.int64)


def _blame_cell(path: str | Path, name: str, cells: Sequence[str], lines: Sequence[int]) -> None:
    for cell, line in zip(cells, lines, strict=True):
        try:
            float(cell)
        except ValueError:
            what = f"{cell.strip()!r}, not a number" if cell.strip() else "empty"
            raise FileError(path, f"{name} is {what}", line) from None


@contextlib.contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give a temporary folder that becomes ``path`` in the end; ``path`` must be new or empty."""
    folder = Path(os.path.realpath(path))
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise FileError(path, "is there already, and not empty")
    try:
        remove_stale_stages(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        stage, lock = new_stage(folder, inside=False)
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror}") from None
    try:
        yield stage
        stage.replace(folder)
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        release(lock)


def write_json(path: str | Path, content: dict[str, Any]) -> None:
    """Write JSON that every reader accepts: NaN and infinity become null."""
    text = json.dumps(jsonable(content), indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


def jsonable(value: Any) -> Any:
    """Return plain lists, tables, texts and numbers; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return jsonable(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
