"""Figures and studies into the directory of a command's results."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import typer

from dqslam._files import uninterrupted
from dqslam.cli.settings import CONFIG, save_settings

if TYPE_CHECKING:
    from dqslam.cli.output import Output


class Table(Protocol):
    """The table of a study."""

    def save(self, path: Path) -> None:
        """Write it as JSON."""


SomeTable = TypeVar("SomeTable", bound=Table)


def draw_figure(output: Output, path: Path, draw: Callable[[Path], None]) -> None:
    """Draw an image file, or print why there is none: matplotlib is an extra."""
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
    """Write the table of a study, with its options and its figure beside it."""
    with uninterrupted():
        table.save(path)
        save_settings(context, path.with_name(CONFIG))
        output.file(path)
        draw_figure(output, path.with_suffix(".png"), lambda image: draw(table, image))
