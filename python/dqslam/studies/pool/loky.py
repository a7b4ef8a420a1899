"""Items in processes of this machine, by joblib's loky."""

import os
import warnings
from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

from dqslam.studies.pool.processes import end_with_parent, interrupts_held

Item = TypeVar("Item")
Result = TypeVar("Result")


def run_in_loky(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: int
) -> Generator[Result, None, None]:
    """Yield results as processes finish them."""
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.backend import resource_tracker

    resource_tracker.ensure_running()  # as in `interrupts_held`; loky has its own
    with parallel_config(
        "loky", inner_max_num_threads=1, initializer=end_with_parent, initargs=(os.getpid(),)
    ):
        parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        with interrupts_held():  # until processes have started
            results = parallel(delayed(function)(item) for item in items)
    try:
        # "yield from" would pass a stop on to joblib and skip the code below.
        for result in results:  # noqa: UP028
            yield result
    finally:
        with warnings.catch_warnings():  # joblib warns of results that nobody takes
            warnings.simplefilter("ignore")
            results.close()
