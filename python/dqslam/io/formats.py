"""File formats, and the choice of the format of a file: by name, else by its content."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from dqslam.io.files import FileError, read_rows

Content = TypeVar("Content")
Progress = Callable[[float], None]
"""A function that is called with the share of a file, 0 to 1, that has been read."""

# Keys that identify a file are looked for in its first bytes.
HEAD_BYTES = 1 << 16


def no_progress(share: float) -> None:
    """Ignore the share."""


@dataclass(frozen=True)
class Look:
    """The properties that identify a format: the path, and the first line that is not a comment."""

    path: Path
    first: str  #: "" if the path is a folder or not a text

    @property
    def suffix(self) -> str:
        """Return the ending of the name in lower case, with its dot."""
        return self.path.suffix.lower()


@dataclass(frozen=True)
class Format(Generic[Content]):
    """One file format of cameras, trajectories or detections."""

    name: str
    looks: str  #: the properties that identify it, in words
    recognize: Callable[[Look], bool]
    read: Callable[..., Content]
    write: Callable[..., None] | None = None
    needs_times: bool = True  #: if False, a file may count frames and have no times
    has_times: Callable[[Path], bool] = lambda _: True  #: returns whether a file has times
    endings: tuple[str, ...] = ()  #: endings of files that are written in this format by default
    loses: tuple[str, ...] = ()  #: the data that the format lacks
    tells_share: bool = False  #: whether `read` has a `progress`, a `Progress`


def choose_format(
    path: str | Path, name: str | None, formats: Sequence[Format[Content]], kind: str
) -> Format[Content]:
    """Find the format with this name, or the first that the file looks like.

    Raises
    ------
    ValueError
        If no format has the name.
    FileError
        If there is no such file, or it looks like none of the formats.
    """
    if name is not None:
        return named_format(name, formats, kind)
    look = look_at(path)
    for format_ in formats:
        if format_.recognize(look):
            return format_
    if look.path.is_dir():
        raise FileError(path, "cannot be read: Is a directory")
    if look.first == "":
        read_rows(path)  # names what is wrong: empty, comments only, or no text
    tried = "; ".join(f"{format_.name}: {format_.looks}" for format_ in formats)
    raise FileError(path, f"{kind} in no known format ({tried}); name it with --format")


def named_format(name: str, formats: Sequence[Format[Content]], kind: str) -> Format[Content]:
    """Find the format with this name."""
    for format_ in formats:
        if format_.name == name:
            return format_
    known = ", ".join(format_.name for format_ in formats)
    raise ValueError(f"format {name!r} is none of {kind} formats: {known}")


def head(look: Look) -> str:
    """Return the beginning of a text file, enough to see its keys; "" of anything else."""
    with contextlib.suppress(OSError), look.path.open("rb") as file:
        return file.read(HEAD_BYTES).decode("utf-8-sig", errors="replace")
    return ""


def look_at(path: str | Path) -> Look:
    """Return the look of a file or folder, which must exist."""
    path = Path(path)
    if not path.exists():
        raise FileError(path, "no such file")
    first = ""
    if path.is_file():
        with (
            contextlib.suppress(OSError, UnicodeDecodeError),
            path.open(encoding="utf-8-sig") as file,
        ):
            rows = (line.strip() for line in file)
            first = next((row for row in rows if row and not row.startswith("#")), "")
    return Look(path, first)
