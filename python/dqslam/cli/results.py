"""The directory of a command's results, which are written all or not at all."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import typer

from dqslam.cli.settings import CONFIG, save_settings

if TYPE_CHECKING:
    from dqslam.cli.output import Output


class Table(Protocol):
    """The table of a study."""

    def save(self, path: Path) -> None:
        """Write it as JSON."""


SomeTable = TypeVar("SomeTable", bound=Table)


@contextmanager
def results_directory(path: Path) -> Iterator[None]:
    """Make a directory before the work starts; if the work fails, remove it if it is empty."""
    missing = [one for one in (path, *path.parents) if not one.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # it is not empty
            for one in missing:
                one.rmdir()
        raise


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C until all files of a result are written, because they belong together."""
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


def draw_figure(output: Output, path: Path, draw: Callable[[Path], None]) -> None:
    """Draw an image file, or print why there is none, because figures are an extra."""
    if find_spec("matplotlib") is None:
        output.line(f"no {path.name}: matplotlib is missing (pip install 'dqslam[plot]')")
        return
    with output.waiting("drawing"):
        draw(path)
    output.line(f"wrote {path}")


def save_study(
    context: typer.Context,
    output: Output,
    table: SomeTable,
    path: Path,
    draw: Callable[[SomeTable, Path], None],
) -> None:
    """Write the table of a study, the options that made it, and its figure beside it."""
    with uninterrupted():
        table.save(path)
        save_settings(context, path.with_name(CONFIG))
        output.file(path)
        draw_figure(output, path.with_suffix(".png"), lambda image: draw(table, image))
