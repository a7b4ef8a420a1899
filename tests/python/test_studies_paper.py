import json
import multiprocessing
from dataclasses import replace

import numpy as np
import pytest

from dqslam import BoxNoise, SizePrior, SolveOptions, _core, load_scenario, simulate, solve
from dqslam.metrics import Report, evaluate
from dqslam.studies.paper import (
    Assumptions,
    PaperTrial,
    ScoredSolve,
    Settings,
    Statistics,
    assumptions_of,
    example_maps,
    method_options,
    methods,
    run_paper,
    tabulate,
)
from dqslam.studies.paper import trial as trial_module
from dqslam.studies.paper.scores import BoundScore, RobustScore, score_robust

PAPER = load_scenario("paper")
HONEST = load_scenario("honest")
PER_OBJECT = ("object_ids", "class_names", "observations", "dual_quadrics", "ellipsoids")


def report(error):
    """A report whose errors are error, 2 error and 3 error, and 0.1 and 0.3 of the volumes."""
    return Report(error, 5.0, 2.0 * error, 3.0 * error, 1, 0, volume_relative_errors=(0.1, 0.3))


def trial(seed, *errors):
    """One solve per error; None is a failure. Relative positions halve the error."""
    return PaperTrial(
        seed,
        odometry_rmse_pos=10.0 + seed,
        solves={
            "monocular": tuple(solved(error) for error in errors),
            "relative_position": tuple(solved(error and error / 2.0) for error in errors),
        },
    )


def solved(error):
    if error is None:
        return ScoredSolve(None, 9.0, "ValueError: no")
    return ScoredSolve(report(error), 1.0)


def with_sigmas(monkeypatch, *sigmas):
    monkeypatch.setattr(methods, "ALGEBRAIC_SIGMAS", sigmas)


def test_table_by_hand():
    table = tabulate([trial(0, 1.0), trial(1, 2.0), trial(2, 6.0)], PAPER, Settings())
    assert table.as_dict() == {
        "trials": 3,
        "seed": 0,
        "scenario": "paper",
        "objects": "cubes",
        "method": "dqslam",
        "loss": "none",
        "odometry": {"rmse_pos": {"avg": 11.0, "med": 11.0, "max": 12.0}},
        "monocular": {
            "rmse_pos": {"avg": 3.0, "med": 2.0, "max": 6.0},
            "rmse_landmark": {"avg": 6.0, "med": 4.0, "max": 12.0},
            "rmse_volume": {"avg": 9.0, "med": 6.0, "max": 18.0},
            "volume_relative_error": {"avg": pytest.approx(0.2), "med": pytest.approx(0.2)},
            "failures": 0,
            "worse_than_odometry": [2],
            "seconds_per_trial": {"med": 1.0},
        },
        "relative_position": {
            "rmse_pos": {"avg": 1.5, "med": 1.0, "max": 3.0},
            "rmse_landmark": {"avg": 3.0, "med": 2.0, "max": 6.0},
            "rmse_volume": {"avg": 4.5, "med": 3.0, "max": 9.0},
            "volume_relative_error": {"avg": pytest.approx(0.2), "med": pytest.approx(0.2)},
            "failures": 0,
            "worse_than_odometry": [],
            "seconds_per_trial": {"med": 1.0},
        },
    }


def test_failed_trials_are_counted_and_named():
    table = tabulate([trial(4, 1.0), trial(5, None), trial(6, 3.0)], PAPER, Settings())
    row = table.best("monocular")
    assert row.failures == {5: "ValueError: no"}
    assert row.metrics["rmse_pos"] == Statistics(avg=2.0, med=2.0, max=3.0)
    assert table.as_dict()["monocular"]["failures"] == 1
    assert table.as_dict()["trials"] == 3


def test_json_has_null_where_no_trial_succeeded(tmp_path):
    path = tmp_path / "deep" / "table.json"
    tabulate([trial(0, None)], PAPER, Settings()).save(path)
    table = json.loads(path.read_text())
    assert table["monocular"]["rmse_pos"] == {"avg": None, "med": None, "max": None}
    assert table["monocular"]["failures"] == 1
    assert [file.name for file in path.parent.iterdir()] == ["table.json"]


def test_scores_by_hand():
    """Efficiency is mean error / mean bound; the intervals are those of 6 degrees of freedom."""
    bounds = [BoundScore(0.5, 1.0, 0.8, 3, 2.0, True), BoundScore(1.5, 2.0, 1.6, 3, 1.0, False)]
    robust = [RobustScore(1.0, 0.8, 0.3, 0.1, 1), RobustScore(0.9, 0.6, 0.5, 0.4, 2)]
    solves = [
        ScoredSolve(report(error), 1.0, bound=bound, robust=one)
        for error, bound, one in zip((1.0, 2.0), bounds, robust, strict=True)
    ]
    solves.append(ScoredSolve(None, 1.0, "ValueError: no"))
    trials = [
        PaperTrial(seed, 5.0, {"monocular": (one,), "relative_position": (one,)})
        for seed, one in enumerate(solves)
    ]
    row = tabulate(trials, PAPER, Settings(bound=True)).as_dict()["monocular"]
    assert row["efficiency"] == pytest.approx(1.5 / 1.0)
    assert row["anees"] == pytest.approx(1.5)
    assert row["anees_poses"] == pytest.approx(1.2)
    assert row["anees_interval"] == pytest.approx([1.2373 / 6.0, 14.4494 / 6.0], abs=1e-4)
    assert row["anees_objects"] == pytest.approx(1.5)
    assert row["anees_objects_interval"] == row["anees_interval"]
    assert row["optimum_rate"] == 0.5
    assert row["inlier_precision"] == pytest.approx(0.95)
    assert row["inlier_recall"] == pytest.approx(0.7)
    assert row["oracle_rmse_pos"] == pytest.approx({"avg": 0.4, "med": 0.4, "max": 0.5})
    assert row["oracle_rmse_landmark"] == pytest.approx({"avg": 0.25, "med": 0.25, "max": 0.4})
    assert row["objects_dropped"] == 1.5
    assert row["failures"] == 1


def test_trials_worse_than_their_odometry_are_named():
    """The odometry of a report is 5 m off; a trial that failed is no worse than it."""
    table = tabulate([trial(3, 6.0), trial(4, None), trial(5, 4.0)], PAPER, Settings())
    assert table.best("monocular").worse_than_odometry == (3,)
    written = table.as_dict()
    assert written["monocular"]["worse_than_odometry"] == [3]
    assert written["relative_position"]["worse_than_odometry"] == []


def changed_world(**values):
    world = PAPER.world.model_copy(update=values)
    return PAPER.model_copy(update={"objects": "ellipsoids", "world": world})


def test_the_bound_of_ellipsoids_is_that_of_an_estimator_that_knows_noise_and_sizes():
    chosen = assumptions_of(HONEST, Settings(bound=True))
    assert chosen.box_noise == BoxNoise(1.0, 0.0)
    assert chosen.size_prior == SizePrior(np.log(0.25), np.log(1.22))
    assert (
        assumptions_of(HONEST, Settings())
        == assumptions_of(PAPER, Settings(bound=True))
        == Assumptions()
    )


@pytest.mark.parametrize(
    "world",
    [
        {},
        {"side_mean_m": 2.0, "side_sigma_m": 0.0},
        {"side_sigma_m": 0.01, "semi_axis_factor": (0.2, 3.0)},
    ],
)
def test_true_sizes_are_those_that_are_drawn(world):
    scenario = changed_world(**world)
    prior = assumptions_of(scenario, Settings(bound=True)).size_prior
    truths = [simulate(scenario, seed=seed)[1] for seed in range(40)]
    axes = [_core.axes_from_ellipsoid(row)[1] for one in truths for row in one.ellipsoids]
    assert prior.log_mean == pytest.approx(np.log(axes).mean(), abs=0.06)
    assert prior.log_sigma == pytest.approx(np.log(axes).std(), rel=0.06)


def test_the_scan_keeps_every_weight_and_the_best_is_used(monkeypatch):
    with_sigmas(monkeypatch, 1.0, 10.0, 100.0)
    table = tabulate([trial(0, 4.0, 2.0, 3.0), trial(1, 4.0, 4.0, 5.0)], PAPER, Settings("paper"))
    assert table.best("monocular").algebraic_sigma == 10.0
    written = table.as_dict()
    assert written["monocular"]["rmse_pos"]["avg"] == 3.0
    assert written["scan"]["monocular"][1] == {
        "algebraic_sigma": 10.0,
        "rmse_pos": {"avg": 3.0, "med": 3.0, "max": 4.0},
        "failures": 0,
    }
    assert [one["rmse_pos"]["avg"] for one in written["scan"]["relative_position"]] == [2, 1.5, 2]


def test_a_weight_cannot_win_by_failing(monkeypatch):
    with_sigmas(monkeypatch, 1.0, 10.0, 100.0)
    table = tabulate(
        [trial(0, 0.1, 4.0, None), trial(1, None, 5.0, None)], PAPER, Settings("paper")
    )
    assert table.best("monocular").algebraic_sigma == 10.0


def test_all_weights_may_fail(monkeypatch):
    with_sigmas(monkeypatch, 1.0, 10.0)
    table = tabulate([trial(0, None, None)], PAPER, Settings("paper"))
    assert len(table.best("monocular").failures) == 1


def test_the_papers_method_is_as_published():
    options = method_options(Settings("paper"), 1e9)
    names = [options.residual.name, options.landmark_model.name, options.start.name]
    assert names == ["ALGEBRAIC", "DUAL_QUADRIC", "IDENTITY"]
    assert [options.schedule.name, options.loss.name, options.mode.name] == [
        "BATCH",
        "NONE",
        "SLAM",
    ]
    assert options.algebraic_sigma == 1e9
    np.testing.assert_allclose(np.diff(np.log10(methods.ALGEBRAIC_SIGMAS)), 1.0)


# --- real trials ---------------------------------------------------------------------------------


def errors_of(table):
    return {row: table.best(row).metrics for row in table.scan}


def test_trials_beat_odometry_and_do_not_depend_on_the_processes():
    seen = []
    here = run_paper(
        PAPER, trials=2, seed=6, method="dqslam", progress=lambda *step: seen.append(step)
    )
    assert seen == [(1, 2), (2, 2)]
    assert here.seeds == (6, 7)
    assert here.best("monocular").metrics["rmse_pos"].max < 0.2 * here.odometry.avg
    assert not here.best("relative_position").failures
    apart = run_paper(PAPER, trials=2, seed=6, method="dqslam", jobs=2)
    assert errors_of(apart) == errors_of(here)
    assert apart.odometry == here.odometry


def test_estimates_of_ellipsoids_are_at_the_optimum_and_know_their_error():
    ellipsoids = PAPER.model_copy(update={"objects": "ellipsoids"})
    table = run_paper(ellipsoids, trials=3, seed=6, method="dqslam", bound=True).as_dict()
    for name in ("monocular", "relative_position"):
        row = table[name]
        assert row["optimum_rate"] == 1.0
        assert 0.4 < row["efficiency"] < 1.8
        low, high = row["anees_interval"]
        assert 0.5 * low < row["anees"] < 1.5 * high
        assert 0.5 * low < row["anees_poses"] < 1.5 * high
        assert 0.05 < row["anees_objects"] < 3.0
        assert row["volume_relative_error"]["med"] < 0.05


def test_wrong_ids_are_found():
    wrong = {"wrong_associations": 0.2}
    scenario = PAPER.model_copy(update={"detector": PAPER.detector.model_copy(update=wrong)})
    table = run_paper(scenario, trials=4, seed=6, method="dqslam").as_dict()
    assert (table["wrong_associations"], table["wrong_association_kind"]) == (0.2, "random")
    assert table["loss"] == methods.ROBUST_LOSS
    row = table["monocular"]
    assert row["inlier_precision"] > 0.97
    assert row["inlier_recall"] > 0.85
    assert row["rmse_pos"]["avg"] < 1.5 * row["oracle_rmse_pos"]["avg"] + 0.02
    assert row["rmse_landmark"]["avg"] < 1.5 * row["oracle_rmse_landmark"]["avg"] + 0.05


def test_who_is_told_the_right_ids_is_scored_on_the_same_objects():
    """All boxes are right, and the estimate has every other object."""
    recording, truth = simulate(PAPER, seed=6)
    graph = Assumptions().graph(replace(recording, positions=None))
    estimate, _ = solve(graph, SolveOptions())
    half = replace(estimate, **{name: getattr(estimate, name)[::2] for name in PER_OBJECT})
    score = score_robust(graph, graph.core.boxes.object >= 0, truth, half, SolveOptions())
    assert (score.precision, score.dropped) == (1.0, 0)
    assert score.oracle_rmse_pos == evaluate(estimate, truth).rmse_pos
    assert score.oracle_rmse_landmark == pytest.approx(evaluate(half, truth).rmse_landmark)


def test_the_papers_method_depends_on_its_weight(monkeypatch):
    with_sigmas(monkeypatch, 1e10, 1e15)
    table = run_paper(PAPER, trials=1, seed=6, method="paper")
    good, ignored = (row.metrics["rmse_pos"].avg for row in table.scan["monocular"])
    assert good < 0.5 * table.odometry.avg
    assert ignored == pytest.approx(table.odometry.avg, rel=1e-3)  # boxes do not count any more


def test_a_trial_that_raises_does_not_stop_the_others(monkeypatch):
    real_solve, calls = trial_module.solve, []

    def solve_or_raise(graph, options):
        calls.append(graph)
        if len(calls) == 1:
            raise RuntimeError("the solver\ngave up")
        return real_solve(graph, options)

    monkeypatch.setattr(trial_module, "solve", solve_or_raise)
    table = run_paper(PAPER, trials=1, seed=6, method="dqslam")
    assert table.best("monocular").failures == {6: "RuntimeError: the solver\ngave up"}
    assert table.best("relative_position").failures == {}
    assert example_maps(table, 6) == []  # maps are monocular


def test_an_error_while_processes_run_stops_them():
    def stop(done, trials):
        raise RuntimeError(f"after {done} of {trials}")

    with pytest.raises(RuntimeError, match="after 1 of 3"):
        run_paper(PAPER, trials=3, seed=0, method="dqslam", jobs=2, progress=stop)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"trials": 0}, "trials: expected 1 or more, got 0"),
        ({"seed": -1}, "seed: expected 0 or more, got -1"),
        ({"jobs": 0}, "jobs: expected 1 or more, got 0"),
        ({"loss": "l1"}, "loss: 'l1' is none of none, huber, cauchy, dcs, switchable, gnc_tls"),
        ({"method": "paper", "bound": True}, "the paper's has neither a robust loss nor a bound"),
        ({"method": "paper", "loss": "huber"}, "the paper's has neither a robust loss nor"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        run_paper(PAPER, **{"trials": 1, "seed": 0, "method": "dqslam"} | settings)
