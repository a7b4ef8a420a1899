"""What is shown while trials run."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def show_progress(trials: int) -> Iterator[Callable[[int, int], None]]:
    """Show a bar with the time left on stderr, where that is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = ("trials", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), "left")
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("trials", total=trials)
        yield lambda done, _: bar.update(task, completed=done)
