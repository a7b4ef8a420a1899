"""Process many items in this process, in other processes of this machine, or on a cluster.

The result of an item must not depend on where it runs. Then all backends give the same results.
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
    """Return a generator of function(item) for all items, in the order in which they finish.

    Closing the generator (`contextlib.closing`), an error and Ctrl-C stop the work at once.

    Parameters
    ----------
    function
        A function that can be pickled, of a module that the other processes can import. With
        "serial", any function.
    jobs
        Number of processes on this machine, by default one per core. It does not apply to a
        cluster.
    backend
        "serial" runs in this process, "processes" in others by the standard library, "loky" in
        others by joblib, "dask" and "ray" on a cluster. The default is "serial" for one job, else
        "loky" if joblib is installed, else "processes".
    scheduler
        Address of the cluster: tcp://host:8786 for dask, or an address for `ray.init`. Without
        it, a cluster is started on this machine.

    Raises
    ------
    ValueError
        If the backend is unknown or not installed, or does not fit the other settings.
    """
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs: expected 1 or more, got {jobs}")
    if backend is None:
        backend = "serial" if jobs == 1 else "loky" if find_spec("joblib") else "processes"
    if backend not in BACKENDS:
        raise ValueError(f"backend: {backend!r} is none of {', '.join(BACKENDS)}")
    if scheduler is not None and backend in _LOCAL:
        raise ValueError(f"scheduler: backend {backend} has none; choose dask or ray")
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
