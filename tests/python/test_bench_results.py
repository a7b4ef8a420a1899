"""Results of the benchmarks: tables, comparison, figure."""

import json
import math
from dataclasses import replace

import pytest
from benchmarks import compare, report
from benchmarks.figure import plot_scaling, scaling_cases
from benchmarks.linearize import read_google_benchmark
from benchmarks.results import Measured, Run, load_results, save_results

from bench import TRUE_ANSWER, cells, measured, results


def test_times_by_hand():
    one = measured("peer-1", "dqslam", [1.0, 4.0, 2.0])
    assert one.cpu_s() == pytest.approx((2.0, 1.0, 4.0))
    assert one.cpu_s("build") == pytest.approx((0.4, 0.2, 0.8))
    assert one.wall_s() == pytest.approx((4.0, 2.0, 8.0))


def test_results_survive_their_file(tmp_path):
    undefined = replace(TRUE_ANSWER, box_rms_px=math.nan)
    before = results(
        measured("paper", "dqslam", [1.0]), measured("paper", "x", [1.0], score=undefined)
    )
    save_results(before, tmp_path / "bench.json")
    after = load_results(tmp_path / "bench.json")
    assert after.measured[0] == before.measured[0]
    assert math.isnan(after.measured[1].runs[0].score.box_rms_px)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"bench\.json:1: not JSON"),
        ('{"machine": {}}', r"bench\.json: version: Field required"),
    ],
)
def test_a_broken_file_is_named(tmp_path, text, message):
    (tmp_path / "bench.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        load_results(tmp_path / "bench.json")


def test_speed_table_by_hand():
    size = {"poses": 9, "objects": 2, "boxes": 5}
    failed = Measured("paper", "scipy", size, (Run(failure="too slow"),))
    ours = measured("paper", "dqslam", [2.0, 1.0, 4.0])
    table = report.speed_table(results(ours, measured("paper", "gtsam_quadrics", [6.0]), failed))
    assert cells(table, "over dqslam") == ["1.00", "3.00", ""]
    assert cells(table, "build") == ["0.4", "1.2", "failed"]
    assert list(report.failures(results(ours, failed))) == ["scipy failed on paper: too slow"]
    assert cells(table, "start") == ["-", "-", ""]
    shown = [cells(table, heading)[0] for heading in ("total", "least", "greatest", "wall s")]
    assert shown == ["2", "1", "4", "4"]


def test_split_is_shown_where_it_is_told():
    one = measured("paper", "dqslam", [2.0])
    told = replace(one.runs[0], evaluation_seconds=1.0, linear_solver_seconds=0.5)
    table = report.iteration_table(results(replace(one, runs=(told,)), one))
    headings = ("iterations", "ms each", "evaluate", "factor", "other")
    columns = [cells(table, heading) for heading in headings]
    assert columns == [["10", "10"], ["320", "320"], ["100", "-"], ["50", "-"], ["170", "-"]]


def test_answer_table_by_hand():
    table = report.answer_table(results(measured("paper", "dqslam", [2.0])))
    headings = ("boxes", "RMSE m", "aligned m", "centers m", "boxes px", "impossible", "cost")
    assert [cells(table, heading)[0] for heading in headings] == [
        *("100", "0.1", "0.02", "0.05", "1", "0", "7"),
    ]


def test_nothing_changed():
    same = results(measured("paper", "dqslam", [2.0]))
    (change,) = compare.compare(same, same)
    assert (change.cpu, change.memory, change.yardstick, change.complaints) == (1.0, 1.0, "", ())


def test_a_slower_machine_is_no_slower_program():
    then = results(measured("paper", "dqslam", [1.0]), measured("paper", "gtsam_quadrics", [5.0]))
    now = results(measured("paper", "dqslam", [2.0]), measured("paper", "gtsam_quadrics", [10.0]))
    (change,) = compare.compare(now, then)
    assert (change.cpu, change.yardstick, change.complaints) == (1.0, "gtsam_quadrics", ())


def test_what_is_worse_is_said():
    then = results(measured("paper", "dqslam", [1.0]), measured("peer-1", "dqslam", [1.0]))
    worse = replace(TRUE_ANSWER, aligned_rmse_m=0.03)
    now = results(measured("paper", "dqslam", [2.0], peak=100.0, score=worse))
    (change,) = compare.compare(now, then)  # peer-1 was not asked for
    assert change.complaints == ("slower", "larger", "worse answer")
    assert (change.cpu, change.memory) == (2.0, 2.0)


def test_a_case_that_fails_now_is_said():
    then = results(measured("paper", "dqslam", [1.0]))
    failed = replace(then.measured[0], runs=(Run(failure="no"),))
    (change,) = compare.compare(results(failed), then)
    assert change.complaints == ("fails",)


def test_google_benchmark_by_hand():
    rows = [
        {"run_name": "box/se2", "run_type": "iteration", "cpu_time": 0.7, "time_unit": "us"},
        {"run_name": "box/se2", "run_type": "iteration", "cpu_time": 800.0, "time_unit": "ns"},
        {"run_name": "box/se2", "run_type": "aggregate", "cpu_time": 5.0, "time_unit": "ns"},
    ]
    (found,) = read_google_benchmark(json.dumps({"benchmarks": rows}))
    assert (found.name, found.cpu_ns) == ("box/se2", (pytest.approx(700.0), 800.0))
    assert cells(report.linearized_table([found]), "CPU ns (least, greatest)") == ["750 (700, 800)"]


def test_figure_has_the_chains_by_size(tmp_path):
    pytest.importorskip("matplotlib")
    measurements = results(
        measured("peer-9", "dqslam", [9.0], boxes=900),
        measured("peer-1", "dqslam", [1.0], boxes=100),
        measured("paper", "dqslam", [1.0], boxes=50),
    )
    assert [one.case for one in scaling_cases(measurements)["dqslam"]] == ["peer-1", "peer-9"]
    plot_scaling(measurements, tmp_path / "scaling.png")
    assert (tmp_path / "scaling.png").read_bytes().startswith(b"\x89PNG")
    one_size = results(measured("peer-1", "dqslam", [1.0]), measured("peer-1", "scipy", [9.0]))
    assert scaling_cases(one_size) == {}
    with pytest.raises(ValueError, match="two sizes"):
        plot_scaling(one_size, tmp_path / "none.png")
