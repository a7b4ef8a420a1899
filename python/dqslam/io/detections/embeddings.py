"""What boxes look like: an array of vectors in a ``.npy`` beside a table of boxes.

The array has the name of the table, ``boxes.npy`` beside ``boxes.csv``. Its row i belongs to row i
of the table, which the header and comments are not counted in.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam._files import whole_file
from dqslam._input import is_stream, plain_name
from dqslam.io.files import FileError

ENDING = ".npy"


def embeddings_path(path: str | Path) -> Path:
    """Return the file of the vectors beside a table of boxes."""
    return Path(path).with_name(Path(plain_name(path)).stem + ENDING)


def read_embeddings(path: str | Path, lines: Sequence[int]) -> Floats | None:
    """Read the vectors beside a table of boxes, shape (m, e); None where there is no such file.

    Parameters
    ----------
    path
        The table.
    lines
        The number of the line of each of its rows.

    Raises
    ------
    FileError
        If the file is no array of numbers, has another number of rows than the table, or a vector
        that is not finite or all zero.
    """
    if is_stream(path) or not embeddings_path(path).is_file():
        return None
    file = embeddings_path(path)
    try:
        array = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise FileError(file, f"is no array of NumPy ({error})") from None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu" or array.ndim != 2:
        what = f"{array.dtype} of shape {array.shape}" if isinstance(array, np.ndarray) else "files"
        raise FileError(file, f"holds {what}, not a vector of numbers for each box, shape (m, e)")
    if len(array) != len(lines) or not array.shape[1]:
        raise FileError(
            file,
            f"its shape is {array.shape}, but {path} has {len(lines)} boxes: row i of the array "
            "belongs to row i of the table",
        )
    vectors = array.astype(np.float64)
    with np.errstate(over="ignore"):
        length = np.linalg.norm(vectors, axis=1)
    for bad, why in (
        (~np.isfinite(length), "is not finite"),
        (length == 0.0, "is all zero: it has no direction"),
    ):
        if bad.any():
            row = int(np.argmax(bad))
            raise FileError(file, f"row {row} {why} (the box of {path}:{lines[row]})")
    return vectors


def write_embeddings(path: str | Path, vectors: Floats) -> None:
    """Write vectors (m, e) beside a table of boxes, as 32-bit floats."""
    with whole_file(embeddings_path(path)) as temporary, temporary.open("wb") as file:
        np.save(file, vectors.astype(np.float32))
