"""File formats, the choice of the format of a file, and the one door through which it is read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from dqslam._input import exists, is_stream, plain_name, read_head, refuse_other_files
from dqslam.io.files import FileError, read_rows
from dqslam.io.notes import Notes

if TYPE_CHECKING:
    from dqslam.io.frames import FrameTimes

Content = TypeVar("Content")
Progress = Callable[[float], None]
"""A function that is called with the share of a file, 0 to 1, that has been read."""
MOST_QUOTED = 300  #: characters of a foreign error message


def no_progress(share: float) -> None:
    """Ignore the share."""


@dataclass(frozen=True, kw_only=True)
class ReadContext:
    """What a reader is told beside the file; each part is used by some formats only."""

    size: tuple[int, int] | None = None  #: width and height of the image in px
    frames: FrameTimes | None = None  #: times of frames; they override those of the file
    first_frame: int | None = None  #: the number that the first frame has in the file
    classes: dict[int, str] | None = None  #: names of classes; they override those of the file
    repeated_times: bool = False  #: whether a time that repeats is left out without a note
    topic: str | None = None  #: of a bag
    has_mount: bool = False  #: whether the pose of the camera in the trajectory's body is given
    progress: Progress = no_progress
    notes: Notes = field(default_factory=Notes)


@dataclass(frozen=True)
class Look:
    """The properties that identify a format: the path, and the first line that is not a comment."""

    path: Path
    first: str  #: "" if the path is a folder or not a text
    comments: tuple[str, ...] = ()  #: the lines before the first one, without #
    second: str = ""  #: the next line that is not a comment
    head: str = ""  #: the first 64 KiB of the text

    @property
    def suffix(self) -> str:
        """Return the ending of the name in lower case, with its dot and without ``.gz``.

        Standard input and pipes have no name; JSON is recognized by its first character.
        """
        suffix = Path(plain_name(self.path)).suffix.lower()
        is_json = self.first.startswith(("{", "[{", "[[")) or self.first == "["
        return ".json" if not suffix and is_json else suffix

    @property
    def is_text(self) -> bool:
        """Return whether there is a text with a line that is not a comment."""
        return bool(self.first)


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
        if guarded(path, format_.name, format_.recognize, look):
            return format_
    if look.path.is_dir():
        inner = look.path / "labels"  # as Ultralytics leaves them
        hint = f"; its folder {inner} may be what is meant" if inner.is_dir() else ""
        raise FileError(path, f"cannot be read: Is a directory{hint}")
    refuse_other_files(path)
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


def guarded(path: str | Path, name: str, read: Callable[..., Any], *args: Any, **more: Any) -> Any:
    """Call a reader; whatever a parser raises becomes an error of the file.

    Parsers of other libraries have errors of their own, and a file from elsewhere may reach any of
    them. A missing package is a RuntimeError and stays one.
    """
    try:
        return read(*args, **more)
    except (FileError, RuntimeError) as error:
        if isinstance(error, RecursionError):
            raise FileError(path, "nested too deeply") from None
        raise
    except MemoryError:
        raise FileError(path, f"does not fit into memory as {name}") from None
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from None
    except Exception as error:
        message = f"cannot be read as {name}: {type(error).__name__}: {quoted(error)}"
        raise FileError(path, message) from error


def quoted(error: Exception) -> str:
    """Return the message of another library in one line: some quote a file, which may be long."""
    return " ".join(str(error)[:MOST_QUOTED].split())


def look_at(path: str | Path) -> Look:
    """Return the look of a file or folder, which must exist."""
    path = Path(path)
    if not exists(path):
        raise FileError(path, "no such file")
    if path.is_dir() and not is_stream(path):
        return Look(path, "")
    comments: list[str] = []
    rows: list[str] = []
    head = read_head(path)
    for line in head.split("\n"):
        text = line.strip()
        if text.startswith("#") and not rows:
            comments.append(text.lstrip("#").strip())
        elif text and not text.startswith("#"):
            rows.append(text)
            if len(rows) == 2:
                break
    first, second = (*rows, "", "")[:2]
    return Look(path, first, tuple(comments), second, head)
