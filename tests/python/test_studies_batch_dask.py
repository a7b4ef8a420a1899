"""A batch on a dask cluster of two worker processes, of which one is killed."""

import json

import pytest

from dask_cluster import two_workers
from dqslam.cli.batch_file import load_batch
from dqslam.studies.batch import run_batch
from small_fleet import write_fleet

pytest.importorskip("distributed")
NAMES = "abcd"


def test_a_worker_is_killed_and_nothing_is_lost_or_doubled(tmp_path):
    tasks = load_batch(write_fleet(tmp_path, NAMES)).tasks
    progress_calls = []
    with two_workers(tmp_path) as (scheduler, (victim, survivor)):

        def kill_at_the_first(done, recordings):
            progress_calls.append((done, recordings))
            if done == 1:
                victim.kill()

        done = run_batch(
            tasks,
            tmp_path / "dask",
            backend="dask",
            scheduler=scheduler,
            progress=kill_at_the_first,
        )
        assert victim.wait(timeout=10) == -9
        assert survivor.poll() is None
    assert progress_calls == [(count, 4) for count in range(1, 5)]
    assert (done.done, done.found) == (4, 0)
    assert [(row.name, row.status) for row in done.rows] == [(name, "done") for name in NAMES]
    serial = run_batch(tasks, tmp_path / "serial", backend="serial")
    for name in NAMES:
        hashes = [
            json.loads((tmp_path / where / "recordings" / name / "manifest.json").read_text())
            for where in ("dask", "serial")
        ]
        for one in hashes:
            del one["files"]["config.toml"]  # it names the folder
            del one["files"]["report.json"]  # it has the seconds of the solver
        assert hashes[0] == hashes[1]
    assert [row.iou_median for row in done.rows] == [row.iou_median for row in serial.rows]
