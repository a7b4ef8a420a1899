"""One recording of a batch: its options, and its run in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dqslam._files import write_text
from dqslam._version import version
from dqslam.config import toml_text
from dqslam.studies.batch.store import Record, Store

# `python -m dqslam`, which also ends with the process that has started it.
_PROGRAM = """\
import runpy, sys
from dqslam.studies.pool.processes import end_with_parent
end_with_parent(int(sys.argv.pop(1)))
sys.argv[0] = "dqslam"
runpy.run_module("dqslam", run_name="__main__")
"""
_PREFIX = "dqslam: "


@dataclass(frozen=True)
class Task:
    """A recording, and the options with which ``dqslam run`` estimates it."""

    name: str
    """Name of its folder of results, and of its row in the table."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Options by their names with underscores, as ``dqslam run --config`` reads them, but for
    ``out``. A file or folder is a ``Path``: if it changes, the recording is run again."""

    def __post_init__(self) -> None:
        """Refuse names that are no folder's, and options that the batch chooses itself."""
        if not self.name or self.name.startswith(".") or Path(self.name).name != self.name:
            raise ValueError(f"name: {self.name!r} is not a name that a folder may have")
        if "out" in self.settings:
            raise ValueError(f"{self.name}: out: the batch chooses the folders of results")

    @property
    def plain(self) -> dict[str, Any]:
        """Return the options as a file has them; paths are absolute texts."""
        return {name: _plain(value) for name, value in self.settings.items() if value is not None}

    @property
    def files(self) -> list[Path]:
        """Return the files and folders that are read."""
        return [value for value in self.settings.values() if isinstance(value, Path)]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return os.path.abspath(value) if isinstance(value, Path) else value


@dataclass(frozen=True)
class Job:
    """A task, and the folder of the batch. A worker needs both on a disk that it can reach."""

    task: Task
    folder: str


@dataclass(frozen=True)
class Ended:
    """A task that a worker has run."""

    name: str
    version: str | None
    """Of dqslam on the worker."""


def run_task(job: Job) -> Ended:
    """Run a recording in a new process, and store how that ended.

    A process of its own gives all memory back, and takes nothing along if it is killed. It writes
    the results all together. The record is written before and after.
    """
    task, store = job.task, Store(job.folder)
    config = store.config(task.name)
    settings = {"command": "run", **task.plain, "out": str(store.results(task.name))}
    write_text(config, toml_text(settings))
    record = store.begin(task.name, task.plain, task.files)
    start = time.perf_counter()
    program = [sys.executable, "-c", _PROGRAM, str(os.getpid())]
    done = subprocess.run(
        [*program, "run", "--config", str(config), "--quiet"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )
    store.end(
        record,
        exit_code=done.returncode,
        seconds=time.perf_counter() - start,
        error=None if done.returncode in Record.SUCCESS else why(done.returncode, done.stderr),
    )
    return Ended(task.name, version())


def why(exit_code: int, said: str) -> str:
    """Return the reason for which a run failed, by what it has said on its error stream."""
    if exit_code < 0:
        try:
            name = signal.Signals(-exit_code).name
        except ValueError:
            name = "unknown"
        return f"its process was ended by signal {-exit_code} ({name})"
    lines = [line for line in said.splitlines() if line.strip()]
    errors = [line.removeprefix(_PREFIX) for line in lines if line.startswith(_PREFIX)]
    return "; ".join(errors or lines[-1:]) or f"exit code {exit_code}"
