"""Trials in processes, stopped cleanly by errors and by Ctrl-C."""

import multiprocessing
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def run_each(
    function: Callable[[Item], Result], items: Iterable[Item], *, jobs: int
) -> Iterator[Result]:
    """Yield function(item) of all items: in order here with one job, else as processes finish.

    Ctrl-C in a terminal reaches the processes too, and ends them.
    """
    if jobs == 1:
        yield from map(function, items)
        return
    # Spawned, not forked: the parent may hold locks of threads that a fork would not copy.
    executor = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _end_on_interrupt)
    try:
        with _interrupts_held():  # workers inherit this: while they start they would say much
            futures = [executor.submit(function, item) for item in items]
        for future in as_completed(futures):
            yield future.result()
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Put off Ctrl-C in this thread."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_on_interrupt() -> None:
    """Let Ctrl-C end this process at once and in silence, unless the parent ignores it."""
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
