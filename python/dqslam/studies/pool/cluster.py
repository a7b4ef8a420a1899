"""Items on a cluster, by dask or ray."""

from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack
from itertools import islice
from typing import Any, TypeVar

from dqslam.studies.pool.processes import interrupts_held

Item = TypeVar("Item")
Result = TypeVar("Result")

# Results of ray arrive in chunks. With long chunks, workers seldom wait for the last item. With
# short chunks, a sweep that is stopped loses little.
_RAY_CHUNK = 8  # items of each processor


def run_in_dask(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: int, scheduler: str | None
) -> Generator[Result, None, None]:
    """Yield results as the workers of a scheduler, or new ones of this machine, finish them.

    If a worker is lost, another one takes over its items. This uses dask without joblib, because
    joblib's backend waits for ever if an item ends every worker that takes it.

    Raises
    ------
    ValueError
        If no scheduler answers.
    RuntimeError
        If an item has ended several workers.
    """
    from distributed import Client, KilledWorker, LocalCluster, as_completed

    with ExitStack() as stack:
        if scheduler is None:
            here = {"n_workers": jobs, "threads_per_worker": 1, "dashboard_address": None}
            with interrupts_held():  # workers ignore Ctrl-C; this process ends them
                where: Any = stack.enter_context(LocalCluster(**here))
        else:
            where = scheduler
        try:
            client = stack.enter_context(Client(where, set_as_default=False))
        except OSError as error:
            raise ValueError(f"scheduler: {scheduler} does not answer: {error}") from None
        futures = client.map(function, list(items), pure=False)
        stack.callback(client.cancel, futures)
        try:
            for finished, result in as_completed(futures, loop=client.loop, with_results=True):
                finished.release()
                yield result
        except KilledWorker as error:
            raise RuntimeError(
                f"backend: an item ended each worker that took it: {error}"
            ) from None


def run_in_ray(
    function: Callable[[Item], Result], items: Iterable[Item], jobs: int, scheduler: str | None
) -> Generator[Result, None, None]:
    """Yield results of the cluster at an address, or of this machine, by joblib's backend for ray.

    Results arrive in chunks, in the order of the items.
    """
    import ray
    from joblib import Parallel, delayed, effective_n_jobs, parallel_config
    from ray.util.joblib import register_ray

    if not ray.is_initialized():
        ray.init(scheduler, num_cpus=jobs if scheduler is None else None)
    register_ray()
    with parallel_config("ray"):
        length = _RAY_CHUNK * effective_n_jobs(-1)
    remaining = iter(items)
    while chunk := list(islice(remaining, length)):
        with parallel_config("ray"):
            done = Parallel(n_jobs=-1)(delayed(function)(item) for item in chunk)
        yield from done
