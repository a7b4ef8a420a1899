"""Run the recordings of a batch that are not finished, tabulate all, and combine their maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from dqslam._outputs import added_files, check_added, claim_folder
from dqslam._version import version
from dqslam.io.files import write_json
from dqslam.studies.batch.combine import (
    AlignOptions,
    Combined,
    MergeOptions,
    align_all,
    merge_all,
)
from dqslam.studies.batch.store import Store
from dqslam.studies.batch.table import Row, row_of, write_rows
from dqslam.studies.batch.task import Ended, Job, Task, run_task
from dqslam.studies.pool import Backend, run_each

Progress = Callable[[int, int], None]
WRITTEN_BY = "dqslam batch"
ALIGNMENTS = "alignments.json"
MERGED = "merged"
_TABLES = ("results.csv", "results.parquet")


@dataclass(frozen=True)
class BatchRun:
    """All recordings of a batch."""

    rows: tuple[Row, ...]
    """In the order of the tasks."""
    done: int
    """Number of recordings that were run now."""
    found: int
    """Number of recordings that an earlier run had finished."""
    combined: Combined
    files: tuple[Path, ...]
    """The files and folders that were written in addition to results."""

    def with_status(self, status: str) -> tuple[Row, ...]:
        """Return the rows that are "done", "doubtful" or "failed"."""
        return tuple(row for row in self.rows if row.status == status)


def run_batch(
    tasks: Sequence[Task],
    folder: str | Path,
    *,
    jobs: int | None = None,
    backend: Backend | None = None,
    scheduler: str | None = None,
    align: AlignOptions | None = None,
    merge: MergeOptions | None = None,
    progress: Progress | None = None,
) -> BatchRun:
    """Run each recording that is not finished, and write one table of all.

    If it is stopped or killed, the next call continues: it runs what has no complete results of the
    same options, files and version of dqslam. So it does with failed recordings. A recording that
    fails does not stop the others.

    Parameters
    ----------
    tasks
        Recordings with different names.
    folder
        Folder of ``recordings/NAME``, results.csv, and results.parquet if pyarrow is installed.
        Workers on other machines need it, and the recordings, under the same paths.
    jobs, backend, scheduler
        Where recordings run, as in ``pool.run_each``.
    align
        Align each map with that of the first recording, and write alignments.json.
    merge
        Merge all maps with objects into the folder ``merged``.
    progress
        Called with (recordings finished, recordings) after each of them; those of earlier runs
        count.

    Raises
    ------
    ValueError
        If there is no task, or two have the same name.
    FileError
        If the folder cannot be written or has files of others.
    RuntimeError
        If a worker has another version of dqslam, or does not write into the folder.
    """
    names = [task.name for task in tasks]
    if not names:
        raise ValueError("tasks: there is no recording")
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"tasks: {names.count(name)} recordings have the name {name}")
    claim_folder(folder, WRITTEN_BY)
    check_added(folder, (*_TABLES, ALIGNMENTS), WRITTEN_BY)
    store = Store(folder)
    missing = [task for task in tasks if store.finished(task.name, task.plain, task.files) is None]
    ended, found = 0, len(tasks) - len(missing)
    waiting = [Job(task, str(store.folder)) for task in missing]
    with closing(
        run_each(run_task, waiting, jobs=jobs, backend=backend, scheduler=scheduler)
    ) as running:
        for one in running:
            _check(one)
            ended += 1
            if progress is not None:
                progress(found + ended, len(tasks))
    rows = tuple(_row(store, task) for task in tasks)
    maps = [store.results(row.name) for row in rows if row.status != "failed" and row.objects]
    combined, files = _combine(store.folder, maps, align, merge)
    with added_files(folder, _TABLES, WRITTEN_BY) as stage:
        tables = [store.folder / path.name for path in write_rows(stage, rows)]
    return BatchRun(rows, ended, found, combined, (*tables, *files))


def _row(store: Store, task: Task) -> Row:
    record = store.finished(task.name, task.plain, task.files)
    if record is not None:
        return row_of(record, store.report(task.name))
    record = store.record(task.name)
    if record is None:
        raise RuntimeError(
            f"{task.name}: its worker has left no record in {store.folder}: workers need this "
            "folder under the same path"
        )
    return row_of(record, None)


def _combine(
    folder: Path, maps: list[Path], align: AlignOptions | None, merge: MergeOptions | None
) -> tuple[Combined, list[Path]]:
    files: list[Path] = []
    alignments = () if align is None else align_all(maps, align)
    if align is not None:
        with added_files(folder, (ALIGNMENTS,), WRITTEN_BY) as stage:
            write_json(stage / ALIGNMENTS, {"alignments": list(alignments)})
        files.append(folder / ALIGNMENTS)
    refused = None if merge is None else merge_all(maps, folder / MERGED, merge)
    merged = folder / MERGED if merge is not None and refused is None else None
    files += [] if merged is None else [merged]
    return Combined(alignments, merged, refused), files


def _check(ended: Ended) -> None:
    if ended.version != version():
        raise RuntimeError(f"a worker runs dqslam {ended.version}, this is {version()}")
