"""What is shown while one waits."""

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


@contextmanager
def show_share(title: str) -> Iterator[Callable[[float], None]]:
    """Show a bar of the share that is done, with the time left, where stderr is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

    columns = (title, BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), "left")
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda share: bar.update(task, completed=share)
