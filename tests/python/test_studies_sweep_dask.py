"""A sweep on a dask cluster of two worker processes, of which one is killed."""

import pytest

from dask_cluster import two_workers
from dqslam.studies.sweep import load_sweep, run_sweep

pytest.importorskip("distributed")

SWEEP = """\
scenario = "paper"
trials = 8

[fixed]
scenario.path.laps = 1
scenario.world.object_count = 4

[grid]
scenario.odometry.rotation_sigma_rad = [0.01, 0.02, 0.03]
"""
TRIALS = 24


@pytest.fixture
def cluster(tmp_path):
    with two_workers(tmp_path) as found:
        yield found


def test_a_worker_is_killed_and_nothing_is_lost_or_counted_twice(cluster, tmp_path):
    scheduler, (victim, survivor) = cluster
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    sweep = load_sweep(path)
    progress_calls = []

    def kill_at_the_sixth(done, trials):
        progress_calls.append((done, trials))
        if done == 6:
            victim.kill()

    done = run_sweep(
        sweep, tmp_path / "dask", backend="dask", scheduler=scheduler, progress=kill_at_the_sixth
    )
    assert victim.wait(timeout=10) == -9
    assert survivor.poll() is None
    assert (done.done, done.found, done.failures) == (TRIALS, 0, {})
    assert progress_calls == [(count, TRIALS) for count in range(1, TRIALS + 1)]
    assert len(list((tmp_path / "dask" / "trials").iterdir())) == TRIALS
    run_sweep(sweep, tmp_path / "serial", backend="serial")
    for name in ("results.csv", "summary.json"):
        assert (tmp_path / "dask" / name).read_bytes() == (tmp_path / "serial" / name).read_bytes()
    rows = (tmp_path / "dask" / "results.csv").read_text().splitlines()[1:]
    trials = {tuple(row.split(",")[:3]) for row in rows}
    assert len(rows) == len(trials) == TRIALS
