import csv
import io
import json

import numpy as np
import pytest

from dqslam import load_scenario, simulate, solve
from dqslam._core import Loss, SolveOptions
from dqslam.metrics import position_error
from dqslam.studies.paper import Assumptions
from dqslam.studies.worlds import (
    NUMBERS,
    WorldSolve,
    WorldTrial,
    cells,
    markdown,
    number,
    replace_table,
    run_trial,
    run_worlds,
    save_results,
    summarize,
    usual_rows,
    wrong_parameters,
)
from dqslam.studies.worlds import trial as trial_module
from dqslam.uncertainty import true_state

LOOP = load_scenario("loop")


def short(name, **detector):
    """One lap past few objects, of a world of the battery."""
    scenario = load_scenario(name)
    world = scenario.world.model_copy(update={"object_count": 4})
    detector = scenario.detector.model_copy(update=detector)
    path = scenario.path.model_copy(update={"laps": 1})
    return scenario.model_copy(update={"world": world, "path": path, "detector": detector})


def solved(error, excess, converged=True, **values):
    """An estimate whose center error is twice, whose bound is half, and whose NEES is 1 and 3."""
    scores = {"bound": error / 2.0, "pose_nees": 1.0, "center_nees": 3.0}
    values = {"mapped": 4, "is_optimum": excess <= 0.05, "cpu_seconds": 7.0} | scores | values
    return WorldSolve(error, 2.0 * error, excess_cost=excess, converged=converged, **values)


def trials(*solves, world="loop", odometry=2.0):
    return [
        WorldTrial(world, seed, odometry, {"default": one}) for seed, one in enumerate(solves, 5)
    ]


def of(*solves):
    """The summary of the row of some solves, with seeds from 5."""
    count = range(5, 5 + len(solves))
    return summarize([LOOP], count, trials(*solves)).worlds[0].rows["default"]


# --- what makes sense in a world -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("world", "rows"),
    [
        ("loop", ("told", "default")),
        ("loop_cubes", ("default",)),
        ("loop_cuboids", ("default",)),
        ("false_10", ("told", "default")),
        ("bursts_20", ("told", "default")),
        ("swapped_20", ("told", "default")),
        ("missing_50", ("told", "default")),
        ("focal_2", ("told", "calibrated", "default")),
        ("scale_3", ("told", "calibrated", "default")),
    ],
)
def test_the_rows_that_make_sense(world, rows):
    assert usual_rows(load_scenario(world)) == rows


# --- the summary ---------------------------------------------------------------------------------


def test_a_summary_by_hand():
    row = of(
        solved(0.1, -0.3),
        solved(0.3, 0.05, converged=False),
        solved(2.5, 9.0),
        solved(4.1, 1e4),
        solved(3.0, 11.0, converged=False),
    )
    assert (row.trials, row.compared, row.at_optimum) == (5, 5, 2)
    assert row.lost == (8, 9)  # 9 above the optimum is another minimum, but not lost
    assert row.lost_converged == (8,)
    assert row.optimum_not_converged == (6,)
    assert row.worse_than_odometry == (7, 8, 9)
    assert row.positions.avg == pytest.approx(2.0)
    assert (row.positions.med, row.positions.max) == (2.5, 4.1)
    assert row.centers.avg == pytest.approx(4.0)
    assert row.error_over_bound == pytest.approx(2.0)
    assert (row.pose_nees.avg, row.center_nees.med, row.mapped, row.cpu_seconds) == (1.0, 3.0, 4, 7)


def test_failures_count_but_have_no_numbers():
    failed = WorldSolve(failure="ValueError: no", cpu_seconds=1.0)
    unscored = WorldSolve(1.0, 2.0, 4, converged=True, score_failure="ValueError: behind")
    row = of(solved(0.5, 0.0), failed, unscored)
    assert row.failures == {6: "ValueError: no"}
    assert row.score_failures == {7: "ValueError: behind"}
    assert (row.trials, row.compared, row.at_optimum) == (3, 1, 1)
    assert row.positions.avg == pytest.approx(0.75)
    assert row.error_over_bound == pytest.approx(2.0)
    nothing = of(failed)
    assert np.isnan(nothing.positions.avg)
    assert np.isnan(nothing.error_over_bound)


def test_trials_are_told_apart_by_their_world():
    far = load_scenario("odometry_x4")
    both = trials(solved(1.0, 0.0)) + trials(solved(5.0, 0.0), world="odometry_x4", odometry=20.0)
    summary = summarize([far, LOOP], [5], both[::-1])
    assert [world.scenario.name for world in summary.worlds] == ["odometry_x4", "loop"]
    assert [world.odometry.avg for world in summary.worlds] == [20.0, 2.0]
    assert [world.rows["default"].positions.avg for world in summary.worlds] == [5.0, 1.0]


# --- the table -----------------------------------------------------------------------------------


def test_a_line_of_the_table_by_hand():
    row = of(solved(0.1, 0.0), solved(4.1, 1e4, pose_nees=12345.0), solved(240.0, 1e6))
    world = summarize([LOOP], [5, 6, 7], trials(*[solved(0.1, 0.0)] * 3)).worlds[0]
    assert dict(zip(NUMBERS, cells(world, row), strict=True)) == {
        "optimum": "1 of 3",
        "lost": "2",
        "says converged": "2",
        "positions, m": "81.4 / 4.10 / 240",
        "odometry, m": "2.00",
        "worse": "2",
        "error / bound": "2.00",
        "NEES poses": "4116 / 1.00",
        "NEES centers": "3.00 / 3.00",
        "failed": "",
    }


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.004, "0.00"),
        (9.994, "9.99"),
        (9.996, "10.0"),
        (99.94, "99.9"),
        (99.96, "100"),
        (-12.34, "-12.3"),
        (99999.4, "99999"),
        (123456.0, "1e+05"),
        (float("nan"), ""),
    ],
)
def test_numbers_of_a_table(value, text):
    assert number(value) == text


def test_markdown_and_the_page_that_holds_it(tmp_path):
    summary = summarize([LOOP], [5], trials(solved(0.5, 0.0)))
    table = markdown(summary)
    lines = table.splitlines()
    assert lines[0].endswith("seeds 5 to 5.")
    assert lines[2].startswith("| world | | optimum | lost |") or "| optimum | lost |" in lines[2]
    assert lines[4].startswith("| **The paper's loop** |")
    assert lines[5].startswith(
        "| `loop`: the paper's loop, ellipsoids | default | 1 of 1 | 0 | 0 |"
    )
    assert {line.count("|") for line in lines[2:]} == {13}
    page = tmp_path / "page.md"
    page.write_text("# A\n<!-- table of the worlds -->\nold\n<!-- end of the table -->\n## B\n")
    replace_table(page, summary)
    replace_table(page, summary)
    text = page.read_text()
    assert text.startswith("# A\n<!-- table of the worlds -->\n\n")
    assert text.endswith("\n<!-- end of the table -->\n## B\n")
    assert text.count(table) == 1
    assert "old" not in text
    page.write_text("no marks")
    with pytest.raises(ValueError, match="has no place for a table"):
        replace_table(page, summary)


def test_trials_as_csv_have_nothing_where_nothing_is_known(tmp_path):
    failed = WorldSolve(failure="ValueError: no", cpu_seconds=1.0)
    save_results(summarize([LOOP], [5, 6], trials(solved(0.5, 0.0), failed)), tmp_path)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "trials.csv").read_text())))
    assert [row["seed"] for row in rows] == ["5", "6"]
    assert (rows[0]["position_error"], rows[0]["is_optimum"], rows[0]["converged"]) == (
        "0.5",
        "1",
        "1",
    )
    assert (rows[1]["position_error"], rows[1]["is_optimum"]) == ("", "")
    assert rows[1]["failure"] == "ValueError: no"
    assert "cpu_seconds" not in rows[0]


# --- trials --------------------------------------------------------------------------------------


def test_a_trial_is_the_solve_that_it_says():
    scenario = short("loop")
    trial = run_trial(scenario, 3, ("told", "default", "plain"))
    recording, truth = simulate(scenario, seed=3)
    from dataclasses import replace

    graph = Assumptions().graph(replace(recording, positions=None))
    for row, options in (("default", SolveOptions()), ("plain", SolveOptions(loss=Loss.NONE))):
        estimate, summary = solve(graph, options)
        assert trial.rows[row].position_error == position_error(
            truth.pose_model, estimate.poses, truth.poses
        )
        _, best = solve(graph, options, start=true_state(graph, truth, options))
        assert trial.rows[row].excess_cost == summary.final_cost - best.final_cost
        assert trial.rows[row].converged == summary.converged
    assert trial.odometry_error == position_error(
        truth.pose_model, estimate.initial_poses, truth.poses
    )
    for one in trial.rows.values():
        assert one.is_optimum
        assert not one.is_lost
        assert one.cpu_seconds > 0.0
    assert trial.rows["told"].position_error != trial.rows["default"].position_error
    assert 0.05 < trial.rows["told"].pose_nees < 5.0


def test_objects_that_do_not_exist_are_not_compared_with_any():
    trial = run_trial(short("false_own_20"), 1, ("default",))
    one = trial.rows["default"]
    assert (one.failure, one.score_failure) == ("", "")
    assert one.mapped == 4
    assert np.isfinite([one.center_error, one.center_nees, one.bound, one.excess_cost]).all()


def test_a_start_at_the_truth_maps_what_does_not_exist():
    scenario = short("false_own_20")
    recording, truth = simulate(scenario, seed=1)
    graph = Assumptions().graph(recording)
    state = true_state(graph, truth, SolveOptions())
    np.testing.assert_array_equal(state.poses, truth.poses)
    np.testing.assert_array_equal(state.landmarks[:4], truth.ellipsoids)
    assert len(state.landmarks) == len(graph.object_ids) > 4


def test_the_pipeline_is_a_row_too():
    trial = run_trial(short("loop"), 0, ("run",))
    one = trial.rows["run"]
    assert one.failure == ""
    assert one.position_error < trial.odometry_error
    assert one.is_optimum is None
    assert not one.is_lost
    assert one.mapped >= 3
    assert np.isfinite([one.pose_nees, one.center_nees]).all()


def test_what_is_wrong_with_the_calibration_is_estimated_in_a_row_of_its_own():
    scenario = load_scenario("mount_yaw_2")
    assert wrong_parameters(scenario) == ("mount_yaw",)
    assert wrong_parameters(load_scenario("loop")) == ()
    trial = run_trial(scenario, 1000, ("told", "calibrated"))
    told, calibrated = trial.rows["told"], trial.rows["calibrated"]
    assert calibrated.failure == ""
    assert told.pose_nees > 100.0
    assert calibrated.pose_nees < 3.0
    assert calibrated.position_error < 0.5 * told.position_error
    assert calibrated.is_optimum is None


def test_errors_are_kept_with_what_was_found_before(monkeypatch):
    def fail(*arguments):
        raise RuntimeError("no")

    monkeypatch.setattr(trial_module, "score_bound", fail)
    one = run_trial(short("loop"), 0, ("default",)).rows["default"]
    assert (one.failure, one.score_failure) == ("", "RuntimeError: no")
    assert one.position_error < 1.0
    assert one.is_optimum is None
    monkeypatch.setattr(trial_module, "solve", fail)
    one = run_trial(short("loop"), 0, ("default",)).rows["default"]
    assert one.failure == "RuntimeError: no"
    assert np.isnan(one.position_error)


# --- runs ----------------------------------------------------------------------------------------


def test_the_same_seeds_give_the_same_bytes_wherever_they_run(tmp_path):
    scenarios = [short("loop"), short("false_10")]
    for jobs, backend in ((1, "serial"), (2, "processes")):
        seen = []
        summary = run_worlds(
            scenarios,
            trials=2,
            seed=4,
            rows=("default",),
            jobs=jobs,
            backend=backend,
            progress=lambda done, total, seen=seen: seen.append((done, total)),
        )
        assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
        save_results(summary, tmp_path / backend)
    serial, processes = tmp_path / "serial", tmp_path / "processes"
    for name in ("worlds.md", "trials.csv"):
        assert (serial / name).read_bytes() == (processes / name).read_bytes()
    results = [json.loads((folder / "worlds.json").read_text()) for folder in (serial, processes)]
    for result in results:
        assert result.pop("cpu_seconds").keys() == {"loop", "false_10"}
    assert results[0] == results[1]
    assert results[0]["worlds"]["loop"]["default"]["trials"] == 2


@pytest.mark.parametrize(
    ("scenarios", "changes", "message"),
    [
        ([LOOP], {"trials": 0}, "trials: expected 1 or more, got 0"),
        ([LOOP], {"seed": -1}, "seed: expected 0 or more, got -1"),
        ([], {}, "scenarios: expected one or more, of different names"),
        ([LOOP, LOOP], {}, "scenarios: expected one or more, of different names"),
    ],
)
def test_what_cannot_be_run(scenarios, changes, message):
    with pytest.raises(ValueError, match=message):
        run_worlds(scenarios, **{"trials": 1, "seed": 0} | changes)
