"""Sweeps: files into cells, trials, what is kept and resumed, what is tabulated."""

import csv
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dqslam import BoxNoise, SizePrior, SolveOptions, _core, load_scenario
from dqslam.cli import main
from dqslam.experiment import run_paper
from dqslam.io.files import FileError
from dqslam.sweep import TrialResult, TrialSettings, load_sweep, run_sweep
from dqslam.sweep import run as run_module
from dqslam.sweep import trial as trial_module
from dqslam.sweep.intervals import mean_interval, median_interval, share_interval
from dqslam.sweep.store import Store
from dqslam.sweep.trial import Task, cell_key, run_task

PAPER = load_scenario("paper")
ROTATION = "scenario.odometry.rotation_sigma_rad"
EDGE = "scenario.detector.edge_sigma_px"

# A quick drive: half the way, few objects.
SMALL = """\
scenario = "paper"
trials = 3
seed = 5

[fixed]
scenario.path.laps = 1
scenario.world.object_count = 4

[grid]
scenario.odometry.rotation_sigma_rad = [0.01, 0.02]
"estimator.loss" = ["none", "cauchy"]
"""


@pytest.fixture
def write(tmp_path):
    def write_file(text, name="sweep.toml"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write_file


def rows_of(folder):
    with (folder / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def outputs(folder):
    return [(folder / name).read_bytes() for name in ("results.csv", "summary.json")]


# --- the file ------------------------------------------------------------------------------------


def test_cells_are_the_grid_with_its_last_setting_fastest(write):
    sweep = load_sweep(write(SMALL))
    assert sweep.parameters == (ROTATION, "estimator.loss")
    assert [tuple(cell.values.values()) for cell in sweep.cells] == [
        (0.01, "none"),
        (0.01, "cauchy"),
        (0.02, "none"),
        (0.02, "cauchy"),
    ]
    assert sweep.seeds == (5, 6, 7)
    for cell in sweep.cells:
        scenario = cell.settings.scenario
        assert (scenario.path.laps, scenario.world.object_count) == (1, 4)
        assert scenario.odometry.rotation_sigma_rad == cell.values[ROTATION]
        loss = cell.values["estimator.loss"]
        assert cell.settings.options().loss == _core.Loss[loss.upper()]
        assert scenario.camera == PAPER.camera


def test_a_file_without_varied_settings_is_one_cell_of_50_seeds(write):
    sweep = load_sweep(write('scenario = "honest"\n'))
    assert sweep.parameters == ()
    assert [cell.settings.scenario.name for cell in sweep.cells] == ["honest"]
    assert sweep.seeds == tuple(range(50))


def test_a_scenario_beside_the_file_is_found(write):
    write('base = "paper"\nobjects = "ellipsoids"\n', "mine.toml")
    sweep = load_sweep(write('scenario = "mine.toml"\n'))
    assert sweep.cells[0].settings.scenario.objects == "ellipsoids"


RANDOM = """\
scenario = "paper"
samples = {samples}

[grid]
estimator.loss = ["none", "dcs"]

[random]
scenario.detector.edge_sigma_px = {{ low = 0.5, high = 8.0, log = true }}
scenario.odometry.rotation_sigma_rad = {{ low = 0.01, high = 0.03 }}
scenario.world.object_count = {{ low = 5, high = 8, whole = true }}
"""


def test_random_settings_are_spread_as_told_and_crossed_with_the_grid(write):
    sweep = load_sweep(write(RANDOM.format(samples=400)))
    assert len(sweep.cells) == 800
    edge, rotation, count = (
        np.array([cell.values[name] for cell in sweep.cells])
        for name in (EDGE, ROTATION, "scenario.world.object_count")
    )
    for values in (edge, rotation, count):  # both losses see the same samples
        np.testing.assert_array_equal(values[:400], values[400:])
    assert 0.5 <= edge.min() < 0.52
    assert 7.6 < edge.max() < 8.0
    assert np.median(edge) == pytest.approx(2.0, rel=0.15)  # the geometric mean of both ends
    assert np.mean(rotation) == pytest.approx(0.02, rel=0.05)
    assert set(count.tolist()) == {5, 6, 7, 8}
    assert np.abs(np.corrcoef([np.log(edge), rotation, count])[np.triu_indices(3, 1)]).max() < 0.15


def test_more_samples_add_to_those_there_were(write):
    few = load_sweep(write(RANDOM.format(samples=3)))
    many = load_sweep(write(RANDOM.format(samples=10)))
    assert [cell.values for cell in few.cells[:3]] == [cell.values for cell in many.cells[:3]]
    other = load_sweep(write("sample_seed = 1\n" + RANDOM.format(samples=3)))
    assert other.cells[0].values[EDGE] != few.cells[0].values[EDGE]


def test_all_mistakes_are_named_at_once_with_their_lines(write):
    path = write(
        """\
scenario = "paper"
samples = 2
[fixed]
scenario.objects = "spheres"
scenario.detector.min_side_px = 9.0
[grid]
scenario.odometry.rotation_sigma = [0.01, 0.02]
"estimator.loss" = ["none",
   "cauchi"]
estimator.max_iterations = 3
scenario.detector.min_side_px = [50.0, -1.0, 50.0]
[random]
scenario.detector.edge_sigma_px = { low = 0.5, hig = 8.0 }
scenario.world.object_count = { low = 10, high = 5, whole = true }
scenario.odometry.translation_sigma_m = 3
"""
    )
    with pytest.raises(FileError) as caught:
        load_sweep(path)
    said = str(caught.value).replace(f"{path}:", "").splitlines()
    for mistake in (
        "4: scenario.objects: Input should be 'cubes' or 'ellipsoids', not 'spheres'",
        "7: unknown key scenario.odometry.rotation_sigma; did you mean rotation_sigma_rad?",
        "10: estimator.max_iterations: expected values, like [1, 2]",
        "11: scenario.detector.min_side_px: 50.0 stands twice",
        "11: scenario.detector.min_side_px: Input should be greater than or equal to 0, not -1.0",
        "13: scenario.detector.edge_sigma_px.high is missing",
        "13: unknown key scenario.detector.edge_sigma_px.hig; did you mean high?",
        "14: scenario.world.object_count: low, 10, is not below high, 5",
        "15: scenario.odometry.translation_sigma_m: expected a range, "
        "like { low = 1.0, high = 2.0 }",
        "11: scenario.detector.min_side_px is in another table too",
    ):
        assert mistake in said
    assert any(line.startswith("9: estimator.loss: Input should be 'none', ") for line in said)
    assert len(said) == len(set(said))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('scenario = "moon"', "1: scenario: moon: no such scenario; by name there are: honest"),
        ("trials = 3", "scenario is missing"),
        ('scenario = "paper"\ntrials = 0', "2: trials: Input should be greater than"),
        ('scenario = "paper"\ntrails = 9', "2: unknown key trails; did you mean trials?"),
        ('scenario = "paper"\nsamples = 9', "2: samples: no setting is random"),
        ('scenario = "paper"\ngrid.estimator.method = ["paper"]', "algebraic_sigma is missing"),
        (
            'scenario = "paper"\nbound = true\nfixed.estimator.method = "paper"',
            "method: the paper's has neither",
        ),
        ('scenario = "paper"\nrandom.x = { low = 0, high = 1, log = true }', "low is not above 0"),
        ('scenario = "paper"\nrandom.x = { low = 0.5, high = 1, whole = true }', "whole low and"),
        ('scenario = "paper"\n[grid', "2: not a TOML file"),
    ],
)
def test_a_wrong_file_is_refused(write, text, message):
    path = write(text)
    with pytest.raises(FileError) as caught:
        load_sweep(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))


PAGE = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")


def test_the_page_shows_a_file_that_is_right_and_has_all_metrics(write):
    (text,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    sweep = load_sweep(write("samples = 10\n" + text))
    assert len(sweep.cells) * len(sweep.seeds) == 3000
    for name in trial_module.METRICS:
        assert f"`{name}`" in PAGE


# --- settings and trials -------------------------------------------------------------------------


def settings(**estimator):
    return TrialSettings(scenario=PAPER, estimator=estimator)


def test_an_estimator_is_the_default_one_but_for_what_is_said():
    chosen = settings(
        loss="gnc_tls",
        max_iterations=7,
        start="svd",
        box_noise={"pixels": 3.0},
        size_prior={"median_m": 0.5, "spread": math.e},
    )
    options = chosen.options()
    assert (options.loss, options.start) == (_core.Loss.GNC_TLS, _core.Start.SVD)
    assert options.max_iterations == 7
    assert options.loss_scale == SolveOptions().loss_scale
    assert chosen.options(loss="none").loss == _core.Loss.NONE
    assert chosen.believed().box_noise == BoxNoise(3.0, BoxNoise().relative)
    assert chosen.believed().size_prior == SizePrior(math.log(0.5), 1.0)
    assert settings().believed().size_prior == SizePrior()


def test_a_file_has_a_word_for_each_option_of_the_solver():
    names = {name for name in dir(SolveOptions()) if not name.startswith("_")}
    assert names == settings().in_full()["estimator"].keys() - {
        "method",
        "input",
        "box_noise",
        "size_prior",
    }
    assert names <= type(settings().estimator).model_fields.keys()


def test_wrong_ids_have_a_robust_loss_unless_another_is_chosen():
    detector = PAPER.detector.model_copy(update={"wrong_associations": 0.2})
    wrong = PAPER.model_copy(update={"detector": detector})
    assert TrialSettings(scenario=wrong).options().loss == _core.Loss.GNC_GM
    chosen = TrialSettings(scenario=wrong, estimator={"loss": "dcs"})
    assert chosen.options().loss == _core.Loss.DCS


def test_the_papers_method_is_that_of_its_table():
    options = settings(method="paper", algebraic_sigma=1e10).options()
    assert options.residual == _core.Residual.ALGEBRAIC
    assert options.algebraic_sigma == 1e10


def test_a_key_names_all_settings_and_nothing_else():
    key = cell_key(settings())
    assert key == cell_key(settings())
    assert key == cell_key(settings(loss="none"))  # that is the default
    renamed = PAPER.model_copy(update={"name": "other"})
    assert key == cell_key(TrialSettings(scenario=renamed))
    ellipsoids = PAPER.model_copy(update={"objects": "ellipsoids"})
    others = [
        settings(loss="dcs"),
        settings(max_iterations=299),
        settings(input="relative_position"),
        settings(box_noise={"pixels": 3.0}),
        TrialSettings(scenario=ellipsoids),
        TrialSettings(scenario=PAPER, bound=True),
    ]
    assert len({key, *map(cell_key, others)}) == 1 + len(others)


@pytest.mark.parametrize("row", ["monocular", "relative_position"])
def test_a_trial_is_one_of_the_papers(row):
    table = run_paper(PAPER, trials=1, seed=6, method="dqslam").best(row)
    result = run_task(Task("key", settings(input=row), 6))
    for metric in ("rmse_pos", "rmse_landmark", "rmse_volume"):
        assert result.metrics[metric] == table.metrics[metric].avg
    assert (result.metrics["worse_than_odometry"], result.metrics["converged"]) == (0.0, 1.0)
    assert result.metrics["iterations"] > 0.0
    assert "bound" not in result.metrics


def test_bound_and_wrong_ids_add_metrics():
    detector = PAPER.detector.model_copy(update={"wrong_associations": 0.2})
    world = {"objects": "ellipsoids", "detector": detector}
    scenario = PAPER.model_copy(update=world)
    metrics = run_task(Task("key", TrialSettings(scenario=scenario, bound=True), 6)).metrics
    assert metrics["error_over_bound"] == metrics["rmse_pos"] / metrics["bound"]
    assert 0.2 < metrics["error_over_bound"] < 3.0
    assert metrics["inlier_precision"] > 0.9
    assert metrics.keys() == trial_module.METRICS.keys()


def test_an_error_of_the_simulation_is_kept_too():
    detector = PAPER.detector.model_copy(update={"min_side_px": 1e6})
    blind = PAPER.model_copy(update={"detector": detector})
    result = run_task(Task("key", TrialSettings(scenario=blind), 0))
    assert result.metrics == {}
    assert result.failure.startswith("ValueError: ")


# --- what is kept, and gone on with --------------------------------------------------------------


def test_all_backends_give_the_same_bits(write, tmp_path):
    sweep = load_sweep(write(SMALL))
    told = []
    here = run_sweep(
        sweep,
        tmp_path / "serial",
        backend="serial",
        progress=lambda *step: told.append(step),
    )
    assert told == [(done, 12) for done in range(1, 13)]
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


# --- tables --------------------------------------------------------------------------------------


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


# --- intervals -----------------------------------------------------------------------------------


def test_the_interval_of_a_mean_is_students():
    from scipy.stats import ttest_1samp

    values = np.random.default_rng(0).lognormal(size=12)
    expected = ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((expected.low, expected.high))
    assert mean_interval([2.0]) is None
    assert mean_interval([2.0, 2.0]) == (2.0, 2.0)


@pytest.mark.parametrize(
    ("count", "low", "high"), [(6, 1, 6), (9, 2, 8), (10, 2, 9), (25, 8, 18), (50, 18, 33)]
)
def test_the_interval_of_a_median_is_that_of_printed_tables(count, low, high):
    """Ranks as in tables of the sign test at 95 %."""
    values = np.random.default_rng(count).permutation(np.arange(1.0, count + 1.0))
    assert median_interval(values) == (low, high)


def test_few_values_say_nothing_of_a_median():
    assert median_interval([1.0, 2.0, 3.0, 4.0, 5.0]) is None


def test_intervals_of_medians_hold_what_they_say():
    """Of a skewed distribution whose median is 1, in 95 to 98 % of samples."""
    samples = np.random.default_rng(1).lognormal(sigma=1.5, size=(2000, 20))
    held = [low <= 1.0 <= high for low, high in map(median_interval, samples)]
    assert 0.945 < np.mean(held) < 0.975  # exactly 0.9586 for 20 values


def test_the_interval_of_a_share_is_wilsons():
    z, p, n = 1.959964, 0.1, 20
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert share_interval(2, 20) == pytest.approx((middle - half, middle + half), rel=1e-6)
    assert share_interval(0, 20)[0] == pytest.approx(0.0, abs=1e-12)
    assert share_interval(0, 0) is None
