"""Run the missing trials of a sweep, and tabulate all trials."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dqslam._outputs import added_files, check_added, claim_folder
from dqslam._version import version
from dqslam.studies.pool import Backend, run_each
from dqslam.studies.sweep.file import Sweep
from dqslam.studies.sweep.store import Store
from dqslam.studies.sweep.summary import SweepSummary, summarize
from dqslam.studies.sweep.table import write_results
from dqslam.studies.sweep.trial import Task, TrialResult, cell_key, run_task, trial_key

Progress = Callable[[int, int], None]
WRITTEN_BY = "dqslam sweep"
SUMMARY = "summary.json"
TABLES = ("results.csv", "results.parquet", SUMMARY)


@dataclass(frozen=True)
class SweepRun:
    """The result of a sweep, and the number of trials that were finished before."""

    summary: SweepSummary
    done: int
    """Number of trials that were run now."""
    found: int
    """Number of trials that an earlier run had finished."""
    failures: dict[str, str]
    """Errors of the trials that failed, by the names of their files without the suffix."""
    files: tuple[Path, ...]
    """The files that were written in addition to the trials."""


def run_sweep(
    sweep: Sweep,
    folder: str | Path,
    *,
    jobs: int | None = None,
    backend: Backend | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> SweepRun:
    """Run each trial of a sweep that the folder does not have, store it, and tabulate all trials.

    If it is stopped or killed, the next call continues. After a change of the file, only new trials
    are run; trials that the file no longer has remain in the folder, but are not tabulated.

    Parameters
    ----------
    folder
        Folder of the trials, results.csv, summary.json, and results.parquet if pyarrow is
        installed.
    jobs, backend, scheduler
        Where trials run, as in `pool.run_each`. The results do not depend on it.
    progress
        Called with (trials finished, trials) after each trial; trials of earlier runs count.

    Raises
    ------
    FileError
        If the folder cannot be written, has files of others, or trials of another version of
        dqslam.
    RuntimeError
        If a worker has another version of dqslam, or a trial ends the process that runs it.
    """
    claim_folder(folder, WRITTEN_BY)
    check_added(folder, TABLES, WRITTEN_BY)
    store = Store(folder)
    cells = [cell_key(cell.settings) for cell in sweep.cells]
    tasks = {
        (key := trial_key(name, seed)): Task(key, cell.settings, seed)
        for name, cell in zip(cells, sweep.cells, strict=True)
        for seed in sweep.seeds
    }
    for name, cell in zip(cells, sweep.cells, strict=True):
        store.describe_cell(name, cell.settings)
    results = store.finished(tasks)
    found = len(results)
    missing = [task for key, task in tasks.items() if key not in results]
    start = partial(run_each, jobs=jobs, backend=backend, scheduler=scheduler)
    with closing(start(run_task, missing)) as running:
        for result in running:
            _check_version(result)
            store.save(result)
            results[result.key] = result
            if progress is not None:
                progress(len(results), len(tasks))
    ordered = [[results[trial_key(name, seed)] for seed in sweep.seeds] for name in cells]
    summary = summarize(sweep, cells, ordered)
    with added_files(folder, TABLES, WRITTEN_BY) as stage:
        files = [*write_results(stage, sweep, cells, ordered), stage / SUMMARY]
        summary.save(files[-1])
    return SweepRun(
        summary=summary,
        done=len(missing),
        found=found,
        failures={key: results[key].failure for key in tasks if results[key].failure},
        files=tuple(store.folder / file.name for file in files),
    )


def _check_version(result: TrialResult) -> None:
    if result.version != version():
        raise RuntimeError(f"a worker runs dqslam {result.version}, this is {version()}")
