"""Files that are complete or absent, with errors that name file and line."""

from __future__ import annotations

import contextlib
import errno
import gzip
import os
import re
import secrets
import shutil
import signal
import stat
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from dqslam._exchange import is_stage

# A message that quotes a file may not be as long as the file.
MOST_CHARACTERS = 1200


class FileError(ValueError):
    """A mistake in a file, as ``path:line: message`` or ``path: message``."""

    def __init__(self, path: str | Path, message: str, line: int | None = None) -> None:
        if len(message) > MOST_CHARACTERS:
            message = message[:MOST_CHARACTERS] + "..."
        super().__init__(f"{path}: {message}" if line is None else f"{path}:{line}: {message}")
        self.path, self.message, self.line = path, message, line


class FileErrors(FileError):
    """All that is wrong in a file, a line each, in the order of the file."""

    def __init__(self, errors: Sequence[FileError]) -> None:
        in_order = sorted(errors, key=lambda error: error.line or 0)
        ValueError.__init__(self, "\n".join(map(str, in_order)))
        self.line = in_order[0].line
        self.errors = tuple(errors)


def write_text(path: str | Path, parts: str | Iterable[str]) -> None:
    """Write a text file, all of it or nothing; packed by gzip if its name ends with ``.gz``."""
    parts = [parts] if isinstance(parts, str) else parts
    with whole_file(path) as temporary:
        if temporary.suffix.lower() == ".gz":
            # Without the time, so that the same text gives the same file.
            with (
                temporary.open("wb") as raw,
                gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed,
            ):
                packed.writelines(part.encode() for part in parts)
        else:
            with temporary.open("w", encoding="utf-8", newline="\n") as file:
                file.writelines(parts)


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary file that becomes ``path`` if all goes well: nobody sees half a file.

    It has the same suffix, by which some writers choose the format. If ``path`` is a link, the file
    that it leads to is replaced and the link stays. A pipe, a device or an open descriptor such as
    ``/dev/stdout`` is written to at the end, and never replaced.
    """
    given = Path(path)
    try:
        special = _opener_of_special(given)
        target = given if special else Path(os.path.realpath(given))
        folder = Path(tempfile.gettempdir()) if special else target.parent
        folder.mkdir(parents=True, exist_ok=True)
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        temporary = _new_file(folder, target)
    except OSError as error:
        raise FileError(given, f"cannot be written: {error.strerror or error}") from None
    try:
        yield temporary
        if special:
            with temporary.open("rb") as content, special() as stream:
                shutil.copyfileobj(content, stream)
        else:
            if not is_stage(target.parent.name):  # whose files go to the disk together
                sync(temporary)
            if target.exists():
                shutil.copymode(target, temporary)
            temporary.replace(target)
    except OSError as error:
        raise FileError(given, f"cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def _new_file(folder: Path, target: Path) -> Path:
    """Make an empty file under a name that nobody can foresee; never follow a link."""
    path = folder / f".{target.stem[:100]}.{secrets.token_hex(8)}.tmp{target.suffix}"
    flags = os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_WRONLY | os.O_CLOEXEC
    os.close(os.open(path, flags, 0o666))
    return path


_DESCRIPTOR = re.compile(r"/dev/(?:fd|std(?P<name>in|out|err))(?:/(?P<number>\d+))?")


def _opener_of_special(path: Path) -> Callable[[], BinaryIO] | None:
    """Return what opens a path that is no ordinary file for writing; None for an ordinary one."""
    absolute = os.path.abspath(path).replace("/proc/self/fd/", "/dev/fd/")
    descriptor = _DESCRIPTOR.fullmatch(absolute)
    if descriptor is not None and path.exists():
        names = {"in": 0, "out": 1, "err": 2}
        number = names.get(descriptor["name"], int(descriptor["number"] or -1))
        # Opening the name again would write over what is behind the descriptor from its beginning.
        return lambda: os.fdopen(os.dup(number), "wb")
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISREG(mode):
        return None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if stat.S_ISSOCK(mode):
        raise OSError(errno.ENXIO, "it is a socket")
    return lambda: os.fdopen(os.open(path, os.O_WRONLY | os.O_NOCTTY | os.O_CLOEXEC), "wb")


def sync(path: str | Path) -> None:
    """Let the disk have a file, or the entries of a folder, before anything else is written."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def refuse_inputs(out: str | Path, inputs: Iterable[str | Path | None]) -> None:
    """Raise FileError if an output file is one of the inputs, under whatever name."""
    if any(is_input(out, one) for one in inputs if one is not None):
        raise FileError(out, "is an input, which would be written over")


def is_input(out: str | Path, given: str | Path) -> bool:
    """Return whether an output file is an input, under whatever name."""
    place = input_place(given)
    if not Path(out).exists() or not place.exists() or place.is_char_device():
        return False
    return place.samefile(out)


def input_place(given: str | Path) -> Path:
    """Return where an input is: standard input, ``-``, may come from a file, too."""
    return Path("/dev/stdin" if str(given) == "-" else given)


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Put off Ctrl-C until all files of a result are there, which belong together."""
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        yield
        return
    asked: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if asked:
        raise KeyboardInterrupt
