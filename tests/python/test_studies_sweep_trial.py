"""Settings of a trial, what names it, and what it measures."""

import math

import pytest

from dqslam import UNKNOWN_SIZE, BoxNoise, SizePrior, SolveOptions, _core, load_scenario
from dqslam.studies.paper import run_paper
from dqslam.studies.sweep import TrialSettings
from dqslam.studies.sweep import trial as trial_module
from dqslam.studies.sweep.trial import Task, cell_key, run_task

PAPER = load_scenario("paper")


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
    assert chosen.assumptions().box_noise == BoxNoise(3.0, BoxNoise().relative)
    assert chosen.assumptions().size_prior == SizePrior(math.log(0.5), 1.0)
    assert settings().assumptions().size_prior == UNKNOWN_SIZE


def test_a_file_has_a_word_for_each_option_of_the_solver():
    names = {name for name in dir(SolveOptions()) if not name.startswith("_")}
    assert names == settings().in_full()["estimator"].keys() - {
        "method",
        "input",
        "box_noise",
        "size_prior",
        "shape",
    }
    assert names <= type(settings().estimator).model_fields.keys()


def test_the_shape_of_the_estimate_is_a_setting():
    assert settings().assumptions().shape == "ellipsoid"
    assert settings(shape="cuboid").assumptions().shape == "cuboid"
    with pytest.raises(ValueError, match="no shapes but its quadrics"):
        settings(method="paper", algebraic_sigma=1e10, shape="cuboid")


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
