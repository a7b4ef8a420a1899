"""Sweeps that are run, stopped and gone on with, and their tables."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from dqslam import _core
from dqslam.cli import main
from dqslam.io.files import FileError
from dqslam.studies.sweep import TrialResult, load_sweep, run_sweep
from dqslam.studies.sweep import run as run_module
from dqslam.studies.sweep import trial as trial_module
from dqslam.studies.sweep.store import Store
from dqslam.studies.sweep.trial import cell_key
from small_sweep import ROTATION, SMALL, sweep_file


@pytest.fixture
def write(tmp_path):
    return partial(sweep_file, tmp_path)


def rows_of(folder):
    with (folder / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def outputs(folder):
    return [(folder / name).read_bytes() for name in ("results.csv", "summary.json")]


def test_all_backends_give_the_same_bits(write, tmp_path):
    sweep = load_sweep(write(SMALL))
    progress_calls = []
    here = run_sweep(
        sweep,
        tmp_path / "serial",
        backend="serial",
        progress=lambda *step: progress_calls.append(step),
    )
    assert progress_calls == [(done, 12) for done in range(1, 13)]
    assert (here.done, here.found, here.failures) == (12, 0, {})
    expected = outputs(tmp_path / "serial")
    for backend in ("processes", "loky"):
        run_sweep(sweep, tmp_path / backend, jobs=2, backend=backend)
        assert outputs(tmp_path / backend) == expected
    rows = rows_of(tmp_path / "serial")
    assert [int(row["seed"]) for row in rows] == [5, 6, 7] * 4
    assert [row["estimator.loss"] for row in rows] == (["none"] * 3 + ["cauchy"] * 3) * 2
    assert not any(name.startswith(".") for name in os.listdir(tmp_path / "serial" / "trials"))


def count_tasks(monkeypatch):
    run, ran = trial_module.run_task, []

    def counted(task):
        ran.append(task.key)
        return run(task)

    monkeypatch.setattr(run_module, "run_task", counted)
    return ran


def test_nothing_is_run_twice_and_what_is_new_in_the_file_is_run(write, tmp_path, monkeypatch):
    ran = count_tasks(monkeypatch)
    out = tmp_path / "out"
    run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    before = outputs(out)
    again = run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    assert (again.done, again.found, len(ran)) == (0, 12, 12)
    assert outputs(out) == before
    more = SMALL.replace("trials = 3", "trials = 4").replace("[0.01, 0.02]", "[0.02, 0.03]")
    other = run_sweep(load_sweep(write(more)), out, jobs=1)
    # 2 x 3 of rotation 0.02 were there; a fourth seed of these, and 2 x 4 of 0.03, were not.
    assert (other.done, other.found) == (10, 6)
    assert len(set(ran)) == len(ran) == 22
    assert len(rows_of(out)) == 16  # those of 0.01 stay, and are not shown
    assert len(list((out / "trials").iterdir())) == 22


def test_a_torn_file_is_no_result(write, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    before = outputs(out)
    first, second, *_ = sorted((out / "trials").iterdir())
    first.write_text("")
    second.write_text(second.read_text()[:40])
    ran = count_tasks(monkeypatch)
    run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    assert sorted(ran) == [first.stem, second.stem]
    assert outputs(out) == before


def test_failures_are_kept_counted_and_not_repeated(write, tmp_path, monkeypatch):
    real_solve = trial_module.solve_and_score.__globals__["solve"]

    def solve(graph, options, **start):
        if options.loss == _core.Loss.CAUCHY:
            raise RuntimeError("no, really")
        return real_solve(graph, options, **start)

    monkeypatch.setitem(trial_module.solve_and_score.__globals__, "solve", solve)
    out = tmp_path / "out"
    done = run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    assert set(done.failures.values()) == {"RuntimeError: no, really"}
    assert [row["failure"] for row in rows_of(out)] == (
        [""] * 3 + ["RuntimeError: no, really"] * 3
    ) * 2
    summary = json.loads((out / "summary.json").read_text())
    assert [cell["failed"]["count"] for cell in summary["cells"]] == [0, 3, 0, 3]
    assert summary["cells"][1]["metrics"] == {}
    ran = count_tasks(monkeypatch)
    run_sweep(load_sweep(write(SMALL)), out, jobs=1)
    assert ran == []


def test_results_of_another_version_do_not_mix(write, tmp_path):
    out = tmp_path / "out"
    sweep = load_sweep(write(SMALL))
    run_sweep(sweep, out, jobs=1)
    path = next((out / "trials").iterdir())
    path.write_text(json.dumps(json.loads(path.read_text()) | {"version": "0.0.1"}))
    with pytest.raises(FileError, match=rf"{path.name}: is of dqslam 0\.0\.1, not "):
        run_sweep(sweep, out, jobs=1)


def test_a_worker_of_another_version_is_refused(write, tmp_path, monkeypatch):
    monkeypatch.setattr(trial_module, "version", lambda: "9.9.9")
    with pytest.raises(RuntimeError, match=r"a worker runs dqslam 9\.9\.9, this is "):
        run_sweep(load_sweep(write(SMALL)), tmp_path / "out", jobs=1)


def test_a_killed_sweep_goes_on_and_repeats_nothing(write, tmp_path):
    path = write(SMALL.replace("trials = 3", "trials = 20"))
    out = tmp_path / "out"
    command = ["sweep", str(path), "--jobs", "2", "--quiet", "--out", str(out)]
    code = "import sys; from dqslam.cli import main; sys.exit(main())"
    process = subprocess.Popen([sys.executable, "-c", code, *command])
    while len(list((out / "trials").glob("*.json"))) < 5 and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    assert process.wait(timeout=60) == -signal.SIGKILL
    kept = {file: file.stat().st_mtime_ns for file in (out / "trials").glob("*.json")}
    assert 5 <= len(kept) < 80
    assert not (out / "results.csv").exists()
    assert main(command) == 0
    assert {file: file.stat().st_mtime_ns for file in kept} == kept
    run_sweep(load_sweep(path), tmp_path / "whole", jobs=1)
    assert outputs(out) == outputs(tmp_path / "whole")


def test_tables_by_hand(write, tmp_path, monkeypatch):
    """Six seeds of two cells; of the second, one fails, and one has an error without a bound."""

    def run(task):
        is_second = task.settings.scenario.odometry.rotation_sigma_rad == 0.02
        if is_second and task.seed == 3:
            return TrialResult(task.key, 3, None, 1.0, {}, 'Error: "no", so')
        error = float(task.seed + 1)
        metrics = {
            "rmse_pos": None if is_second and task.seed == 4 else error,
            "converged": float(task.seed % 2),
        }
        return TrialResult(task.key, task.seed, None, 1.0, metrics)

    monkeypatch.setattr(run_module, "run_task", run)
    monkeypatch.setattr(run_module, "version", lambda: None)
    text = f'scenario = "paper"\ntrials = 6\ngrid.{ROTATION} = [0.01, 0.02]\n'
    out = tmp_path / "out"
    run_sweep(load_sweep(write(text)), out, jobs=1)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["parameters"] == [ROTATION]
    assert summary["units"] == {"rmse_pos": "m"}
    first, second = summary["cells"]
    assert first["values"] == {ROTATION: 0.01}
    error = first["metrics"]["rmse_pos"]
    assert (error["count"], error["mean"], error["median"], error["max"]) == (6, 3.5, 3.5, 6.0)
    half = 2.5705818 * math.sqrt(3.5) / math.sqrt(6.0)  # t of 5 degrees; variance 17.5 / 5
    assert error["mean_interval"] == pytest.approx([3.5 - half, 3.5 + half], rel=1e-6)
    assert error["median_interval"] == [1.0, 6.0]
    assert first["shares"]["converged"]["count"] == 3
    assert second["failed"]["count"] == 1
    assert second["metrics"]["rmse_pos"]["count"] == 4
    assert second["metrics"]["rmse_pos"]["mean"] == 3.0  # 1, 2, 3 and 6
    assert second["metrics"]["rmse_pos"]["median_interval"] is None
    assert second["shares"]["converged"]["share"] == pytest.approx(2.0 / 5.0)
    rows = rows_of(out)
    assert list(rows[0]) == ["cell", ROTATION, "seed", "rmse_pos", "converged", "failure"]
    assert rows[9] | {"cell": ""} == {
        "cell": "",
        ROTATION: "0.02",
        "seed": "3",
        "rmse_pos": "",
        "converged": "",
        "failure": 'Error: "no", so',
    }
    assert [row["rmse_pos"] for row in rows[10:]] == ["", "6.0"]


def test_parquet_has_what_csv_has(write, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "out"
    factors = "scenario.world.semi_axis_factor"
    text = SMALL + f"{factors} = [[0.8, 1.4], [1.0, 1.0]]\n"
    run_sweep(load_sweep(write(text.replace("trials = 3", "trials = 1"))), out, jobs=1)
    table = parquet.read_table(out / "results.parquet").to_pylist()
    rows = rows_of(out)
    assert len(table) == len(rows) == 8
    for ours, row in zip(rows, table, strict=True):
        assert float(ours["rmse_pos"]) == row["rmse_pos"]
        assert (ours["cell"], int(ours["seed"])) == (row["cell"], row["seed"])
        assert json.loads(ours[factors]) == json.loads(row[factors])
    assert json.loads(rows[0][factors]) == [0.8, 1.4]


def test_a_cell_is_described_in_full(write, tmp_path):
    out = tmp_path / "out"
    sweep = load_sweep(write('scenario = "honest"\ntrials = 1\n'))
    run_sweep(sweep, out, jobs=1)
    (path,) = (out / "cells").iterdir()
    written = json.loads(path.read_text())
    assert written["scenario_name"] == "honest"
    assert written["scenario"]["odometry"]["rotation_sigma_rad"] == 0.02
    assert written["estimator"]["residual"] == "tangent_then_box"
    assert path.stem == cell_key(sweep.cells[0].settings)


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="file: cannot be written"):
        Store(tmp_path / "file")
