import json
import re
import struct

import numpy as np
import pytest

from dqslam import load_scenario
from dqslam._core import Loss, Residual, Schedule, Start
from dqslam.cli import main
from dqslam.plot.ablation import plot_ablation
from dqslam.studies import ablation
from dqslam.studies.ablation import (
    CLEAN_VARIANTS,
    ROBUST_VARIANTS,
    VARIANTS,
    WRONG_KINDS,
    AblationTrial,
    Variant,
    VariantSolve,
    run_ablation,
    tabulate,
)

PAPER = load_scenario("paper")
OURS = Variant()
PAPERS = Variant(Residual.ALGEBRAIC, Start.IDENTITY, Schedule.BATCH)
ORACLE = Variant(wrong_ids="random", oracle=True)
GNC = Variant(wrong_ids="random", loss=Loss.GNC_TLS)


@pytest.fixture(scope="module")
def table():
    return run_ablation(PAPER, trials=1, seed=0, variants=(OURS, PAPERS))


def row_of(table, variant):
    (row,) = [row for row in table.rows if row.variant == variant]
    return row


def test_every_part_is_tried_once():
    assert len(set(VARIANTS)) == len(VARIANTS)
    assert len(CLEAN_VARIANTS) == 5 * 4 * 2
    assert len(ROBUST_VARIANTS) == 2 * (len(Loss) + 1)
    assert OURS in CLEAN_VARIANTS
    assert {variant.loss for variant in CLEAN_VARIANTS} == {Loss.NONE}
    assert [variant.loss for variant in ROBUST_VARIANTS if variant.oracle] == [Loss.NONE] * 2


def test_only_what_is_named_differs_from_the_default():
    ours, papers = OURS.options(), PAPERS.options()
    assert (ours.residual, ours.start) == (Residual.TANGENT_THEN_BOX, Start.SPHERE)
    assert (papers.residual, papers.start) == (Residual.ALGEBRAIC, Start.IDENTITY)
    assert (papers.landmark_model.name, papers.algebraic_sigma) == ("DUAL_QUADRIC", 1e10)
    normalized = Variant(Residual.ALGEBRAIC_NORMALIZED).options()
    assert (normalized.landmark_model.name, normalized.algebraic_sigma) == ("ELLIPSOID", 1e8)
    assert papers.max_iterations == ours.max_iterations


def test_ours_reaches_the_optimum_and_the_papers_does_not(table):
    ours, papers = row_of(table, OURS), row_of(table, PAPERS)
    assert (ours.optimum_rate, papers.optimum_rate) == (1.0, 0.0)
    assert 0.2 < ours.error_over_bound < 4.0  # one draw of an error whose expectation is 1
    assert papers.error_over_bound > 5.0 * ours.error_over_bound
    assert ours.iterations_med > 10
    assert ours.seconds_med > 0.0


def test_a_back_end_makes_up_for_wrong_ids():
    table = run_ablation(PAPER, trials=1, seed=6, variants=(ORACLE, GNC))
    oracle, gnc = row_of(table, ORACLE), row_of(table, GNC)
    assert oracle.optimum_rate == 1.0
    assert gnc.error_over_bound < 1.3 * oracle.error_over_bound


def solved(error, reached=True, failure=""):
    return VariantSolve(reached, np.nan if failure else error, 2.0, 10, 0.5, failure)


def test_table_by_hand(tmp_path):
    first = AblationTrial(3, {OURS: solved(2.0), PAPERS: solved(8.0, False)})
    second = AblationTrial(4, {OURS: solved(4.0), PAPERS: solved(0.0, False, "ValueError: no")})
    table = tabulate([first, second])
    ours, papers = table.rows
    assert (ours.optimum_rate, ours.error_over_bound, ours.median_error_over_bound) == (1, 1.5, 1.5)
    assert (papers.optimum_rate, papers.error_over_bound) == (0.0, 4.0)
    assert (papers.iterations_med, papers.seconds_med) == (10.0, 0.5)
    assert papers.failures == {4: "ValueError: no"}
    table.save(tmp_path / "ablation.json")
    written = json.loads((tmp_path / "ablation.json").read_text())
    assert (written["trials"], written["seed"], written["wrong_share"]) == (2, 3, 0.2)
    assert written["algebraic_sigmas"] == {"algebraic": 1e10, "algebraic_normalized": 1e8}
    assert written["rows"][1] == {
        "residual": "algebraic",
        "start": "identity",
        "schedule": "batch",
        "loss": "none",
        "wrong_ids": None,
        "oracle": False,
        "optimum_rate": 0.0,
        "error_over_bound": 4.0,
        "median_error_over_bound": 4.0,
        "iterations_med": 10.0,
        "seconds_med": 0.5,
        "failures": {"4": "ValueError: no"},
    }


def test_where_all_trials_failed_there_is_no_error(tmp_path):
    table = tabulate([AblationTrial(0, {OURS: solved(1.0, False, "RuntimeError: no")})])
    assert np.isnan(table.rows[0].error_over_bound)
    table.save(tmp_path / "ablation.json")
    assert (
        json.loads((tmp_path / "ablation.json").read_text())["rows"][0]["error_over_bound"] is None
    )


def test_a_solve_that_raises_is_kept_as_a_failure(monkeypatch):
    real_solve = ablation._core.solve

    def solve(graph, options, start=None):
        if options.residual == Residual.BOX:
            raise RuntimeError("no way")
        return real_solve(graph, options, start)

    monkeypatch.setattr(ablation._core, "solve", solve)
    boxes = Variant(Residual.BOX)
    table = run_ablation(PAPER, trials=1, seed=6, variants=(boxes, OURS))
    assert row_of(table, boxes).failures == {6: "RuntimeError: no way"}
    assert row_of(table, OURS).optimum_rate == 1.0


def test_the_figure_names_each_loss_and_the_oracle(tmp_path):
    losses = [Variant(loss=loss, wrong_ids=kind) for kind in WRONG_KINDS for loss in Loss]
    oracles = [Variant(wrong_ids=kind, oracle=True) for kind in WRONG_KINDS]
    solves = {one: solved(1.0) for one in (OURS, *oracles, *losses)}
    plot_ablation(tabulate([AblationTrial(0, solves)]), tmp_path / "ablation.svg")
    # matplotlib writes texts as paths, each with the text in a comment
    drawn = re.findall("<!-- (.*) -->", (tmp_path / "ablation.svg").read_text())
    names = ["oracle", "none", "Huber", "Cauchy", "DCS", "switchable", "GNC TLS", "GNC GM"]
    assert [one for one in drawn if one in names] == names


def test_command_writes_table_and_figure(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        ablation, "VARIANTS", (OURS, GNC, Variant(wrong_ids="structured", oracle=True))
    )
    out = tmp_path / "a" / "b"
    command = ["ablation", "--trials", "1", "--seed", "6", "--jobs", "1", "--out", str(out)]
    assert main(command) == 0
    table = json.loads((out / "ablation.json").read_text())
    assert [row["optimum_rate"] for row in table["rows"]][::2] == [1.0, 1.0]  # right ids
    header = (out / "ablation.png").read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert min(struct.unpack(">II", header[16:])) > 500
    shown = capsys.readouterr().out
    for printed in ("tangent then box", "gnc tls", "structured wrong ids", "oracle"):
        assert printed in shown


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"trials": 0}, "trials: expected 1 or more, got 0"),
        ({"seed": -1}, "seed: expected 0 or more, got -1"),
        ({"jobs": 0}, "jobs: expected 1 or more, got 0"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        run_ablation(PAPER, **{"trials": 1, "seed": 0} | settings)
