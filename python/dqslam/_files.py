"""Files and directories of results, complete or absent, with errors that name file and line."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

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
    """Write a text file, all of it or nothing."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines([parts] if isinstance(parts, str) else parts)


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary name that becomes ``path`` if all goes well: nobody sees half a file.

    It has the same suffix, by which some writers choose the format.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror}") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def results_directory(path: Path) -> Iterator[None]:
    """Make a directory before the work is done; if that fails, leave none that is empty."""
    missing = [one for one in (path, *path.parents) if not one.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with contextlib.suppress(OSError):  # it is not empty
            for one in missing:
                one.rmdir()
        raise


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
