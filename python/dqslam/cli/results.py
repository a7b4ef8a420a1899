"""Figures and studies into the directory of a command's results."""

from __future__ import annotations

from collections.abc import Callable
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


def draw_figure(output: Output, path: Path, draw: Callable[[Path], None]) -> str:
    """Draw an image file; return why there is none, or nothing: matplotlib is an extra."""
    if find_spec("matplotlib") is None:
        return f"no {path.name}: matplotlib is missing (pip install 'dqslam[plot]')"
    with output.waiting("drawing"):
        draw(path)
    return ""


def save_study(
    context: typer.Context,
    output: Output,
    table: SomeTable,
    path: Path,
    draw: Callable[[SomeTable, Path], None],
) -> str:
    """Write the table of a study, with its options and its figure beside it; see `draw_figure`."""
    table.save(path)
    save_settings(context, path.with_name(CONFIG))
    return draw_figure(output, path.with_suffix(".png"), lambda image: draw(table, image))


def show_written(output: Output, table: Path, figure: Path, why_not: str) -> None:
    """Print the table that was written, and the figure or why there is none."""
    output.file(table)
    output.line(why_not or f"wrote {figure}")
