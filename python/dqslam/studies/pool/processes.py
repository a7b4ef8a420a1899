"""Items in processes of this machine, by the standard library alone."""

import multiprocessing.resource_tracker
import os
import signal
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from threading import Thread
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

# Items already run in parallel. More threads would only slow each other down.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_in_processes(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: int
) -> Generator[Result, None, None]:
    """Yield results as processes finish them."""
    executor = ProcessPoolExecutor(
        jobs,
        # Processes are spawned, not forked: the parent may hold locks of threads that a fork lacks.
        multiprocessing.get_context("spawn"),
        end_with_parent,
        initargs=(os.getpid(),),
    )
    try:
        # Processes that are interrupted while they start, before `end_with_parent`, print a lot.
        with interrupts_held(), _environment(ONE_THREAD):
            futures = [executor.submit(function, item) for item in items]
        for future in as_completed(futures):
            yield future.result()
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C in this thread, and keep it from the processes that it starts."""
    multiprocessing.resource_tracker.ensure_running()  # its start would enable Ctrl-C again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    """Set the variables that have no value yet, while inside."""
    added = {name: value for name, value in changes.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)


def end_with_parent(parent: int) -> None:
    """Let Ctrl-C and the end of the parent (a process id) end this process at once, silently.

    Ctrl-C is ignored if the parent ignores it.
    """
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    Thread(target=_outlive, args=(parent,), daemon=True).start()


def _outlive(parent: int) -> None:
    """End this process soon after its parent, which may be killed without notice."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
