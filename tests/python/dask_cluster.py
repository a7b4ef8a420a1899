"""A dask cluster of two worker processes of this machine, which nothing starts again."""

import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager


@contextmanager
def two_workers(folder):
    """Give the address of a scheduler and its two workers; their files are in a folder."""
    address = folder / "scheduler.json"
    with ExitStack() as stack:

        def start(*arguments):
            process = subprocess.Popen(
                [sys.executable, "-m", *arguments, "--no-dashboard"],
                env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        where = ["--host", "127.0.0.1", "--scheduler-file", str(address)]
        start("distributed.cli.dask_scheduler", *where, "--port", "0")
        while not address.exists():
            time.sleep(0.02)
        worker = ["distributed.cli.dask_worker", *where, "--nthreads", "1", "--no-nanny"]
        workers = [start(*worker, "--local-directory", str(folder / name)) for name in "ab"]
        scheduler = json.loads(address.read_text())["address"]
        _wait_for_workers(scheduler, 2)
        yield scheduler, workers


def _wait_for_workers(scheduler, count):
    from distributed import Client

    with Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=50)
