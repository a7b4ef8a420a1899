"""The output of a command: tables and lines for people, one JSON document for machines, or nothing.

All of it goes to stdout. Progress goes to stderr, and only if that is a terminal.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dqslam._repr import printable, printable_json

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing but errors.", rich_help_panel="Output")
]
Json = Annotated[
    bool,
    typer.Option(
        "--json", help="Print one JSON document instead of tables.", rich_help_panel="Output"
    ),
]


def _console() -> Console:
    """Return a console that shows control characters of names and never sends them."""
    from rich.console import Console
    from rich.segment import Segment

    class PrintableConsole(Console):
        def render(self, *arguments: Any, **named: Any) -> Iterator[Segment]:
            for segment in super().render(*arguments, **named):
                if segment.control:
                    yield segment
                else:
                    yield Segment(printable(segment.text, keep="\n"), segment.style)

    return PrintableConsole()


class Output:
    """The output of a command.

    Parameters
    ----------
    quiet
        Whether nothing is printed, and no progress is shown.
    as_json
        Whether only `document` prints.
    """

    def __init__(self, *, quiet: bool = False, as_json: bool = False) -> None:
        self._speaks = not quiet and not as_json
        self._shows_progress = not quiet
        self._as_json = as_json

    def table(self, table: RenderableType) -> None:
        """Print a table."""
        if self._speaks:
            _console().print(table)

    def line(self, text: str, *, style: str | None = None) -> None:
        """Print a line as it is, without wrapping."""
        if self._speaks:
            shown = printable(text)
            _console().print(shown, style=style, markup=False, highlight=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print a warning to the error stream, whatever else is printed."""
        typer.secho(f"warning: {printable(text)}", fg="red", err=True)

    def document(self, content: dict[str, Any]) -> None:
        """Print the JSON document if JSON is wanted; NaN and infinity become null."""
        if self._as_json:
            from dqslam.io.files import jsonable

            text = json.dumps(jsonable(content), indent=2, allow_nan=False, ensure_ascii=False)
            typer.echo(printable_json(text))

    def file(self, path: Path) -> None:
        """Print a JSON file that was written if JSON is wanted, or else its path."""
        if self._as_json:
            typer.echo(printable_json(path.read_text(encoding="utf-8")), nl=False)
        self.line(f"wrote {path}")

    @contextmanager
    def trials(self, total: int, what: str = "trials") -> Iterator[Callable[[int, int], None]]:
        """Show a bar of finished trials with the time left, and give the function that updates it.

        It is called with (trials done, trials).
        """
        from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

        columns = (what, BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), "left")
        with self._bar(columns, total) as update:
            yield lambda done, _: update(done)

    @contextmanager
    def share(self, what: str) -> Iterator[Callable[[float], None]]:
        """Show the elapsed time, and a bar with the time left after the first update.

        It gives a function that is called with the share of the work, 0 to 1, that is done.
        """
        from rich.progress import (
            BarColumn,
            SpinnerColumn,
            TaskProgressColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        columns = (
            SpinnerColumn(),
            what,
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            "{task.fields[left]}",
        )
        with self._bar(columns, None) as update:
            yield lambda done: update(done, total=1.0, left="left")

    @contextmanager
    def steps(self, what: str, total: int) -> Iterator[Callable[[], None]]:
        """Show a bar of finished steps with the time left, and give a function that ends a step."""
        with self.share(what) as update:
            ended = count(1)
            yield lambda: update(next(ended) / total)

    @contextmanager
    def live(self, what: str) -> Iterator[Callable[[str], None]]:
        """Show a line that can change, and give the function that sets its text."""
        from rich.console import Console

        console = Console(stderr=True)
        if not self._shows_progress or not console.is_terminal:
            yield lambda text: None
            return
        with console.status(what) as status:
            yield status.update

    @contextmanager
    def waiting(self, what: str) -> Iterator[None]:
        """Show that something of unknown duration is running, and its elapsed time."""
        from rich.progress import SpinnerColumn, TimeElapsedColumn

        with self._bar((SpinnerColumn(), what, TimeElapsedColumn()), None):
            yield

    @contextmanager
    def _bar(self, columns: tuple[Any, ...], total: float | None) -> Iterator[Callable[..., None]]:
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        shown = self._shows_progress and console.is_terminal
        with Progress(*columns, console=console, disable=not shown, transient=True) as bar:
            task = bar.add_task("", total=total, left="")
            yield lambda done, **changes: bar.update(task, completed=done, **changes)
