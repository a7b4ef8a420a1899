"""Many items, side by side: in this process, in others of this machine, or on a cluster.

What an item gives must not depend on where it runs; then all backends give the same.
"""

import os
from collections.abc import Callable, Generator, Iterable
from importlib.util import find_spec
from typing import Literal, TypeVar, get_args

Item = TypeVar("Item")
Result = TypeVar("Result")

Backend = Literal["serial", "processes", "loky", "dask", "ray"]
BACKENDS: tuple[Backend, ...] = get_args(Backend)
_LOCAL: tuple[Backend, ...] = ("serial", "processes", "loky")
_NEEDS = {"loky": "joblib", "dask": "distributed", "ray": "ray"}


def run_each(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    jobs: int | None = None,
    backend: Backend | None = None,
    scheduler: str | None = None,
) -> Generator[Result, None, None]:
    """Return a generator of function(item) of all items: each once, in the order they finish.

    Close it (`contextlib.closing`) to stop at once; an error and Ctrl-C do so too.

    Parameters
    ----------
    function
        Picklable, of a module that the other processes can import, unless it runs in this one.
    jobs
        Processes of this machine, by default one per core; 1 needs no other. A cluster has its own.
    backend
        serial: in this process; processes: others, by the standard library; loky: others, by
        joblib; dask, ray: a cluster. By default loky where joblib is installed, else processes.
    scheduler
        Where the cluster is: tcp://host:8786 of dask, without which one starts on this machine;
        an address as `ray.init` takes it.

    Raises
    ------
    ValueError
        When the backend is unknown or not installed, or does not go with the other settings.
    """
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs: expected 1 or more, got {jobs}")
    if backend is None:
        backend = "serial" if jobs == 1 else "loky" if find_spec("joblib") else "processes"
    if backend not in BACKENDS:
        raise ValueError(f"backend: {backend!r} is none of {', '.join(BACKENDS)}")
    if scheduler is not None and backend in _LOCAL:
        raise ValueError(f"scheduler: backend {backend} has none; say dask or ray")
    if (needed := _NEEDS.get(backend)) is not None and find_spec(needed) is None:
        extra = "ray" if backend == "ray" else "'dqslam[cluster]'"
        raise ValueError(f"backend: {backend} needs {needed}, missing: pip install {extra}")
    jobs = jobs or os.cpu_count() or 1
    if backend == "serial":
        return (function(item) for item in items)
    if backend == "processes":
        from dqslam.studies.pool.processes import run_in_processes

        return run_in_processes(function, items, jobs)
    if backend == "loky":
        from dqslam.studies.pool.loky import run_in_loky

        return run_in_loky(function, items, jobs)
    from dqslam.studies.pool.cluster import run_in_dask, run_in_ray

    on_cluster = run_in_dask if backend == "dask" else run_in_ray
    return on_cluster(function, items, jobs, scheduler)
