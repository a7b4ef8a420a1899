"""The benchmarks at tiny sizes: problems, programs, scores and tables. Nothing asserts a time."""

import importlib
import json
import math
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
import typer
from benchmarks import __main__ as command_line
from benchmarks import compare, measure, peers, report
from benchmarks.cases import CASES, Case
from benchmarks.exchange import Stopwatch, peak_memory_mb, write_answer
from benchmarks.figure import plot_scaling, scaling_cases
from benchmarks.files import load_problem, save_problem
from benchmarks.linearise import read_google_benchmark
from benchmarks.problems import BOX_SIGMA_PX, Problem, chain, paper
from benchmarks.programs import run_dqslam, run_scipy
from benchmarks.results import Measured, Results, Run, Score, Stage, load_results, save_results
from benchmarks.score import score
from typer.testing import CliRunner

from dqslam import BoxNoise, _core, build_graph, solve
from oracle import bounding_box, ellipsoid_surface, se2_matrix

TRUE_ANSWER = Score(0.1, 0.02, 0.05, 1.0, 0)


def cut(problem, poses):
    """Keep the first poses of a problem."""
    recording, odometry = problem.recording, problem.recording.odometry
    kept = recording.detections.pose < poses
    detections = recording.detections.select(kept)
    seen = np.unique(recording.detections.object_id)
    return Problem(
        replace(
            recording,
            timestamps=recording.timestamps[:poses],
            odometry=replace(
                odometry,
                relative=odometry.relative[: poses - 1],
                covariance=odometry.covariance[: poses - 1],
            ),
            detections=detections,
        ),
        replace(problem.truth, poses=problem.truth.poses[:poses], box_object_id=None),
        problem.peer_centers[np.isin(seen, detections.object_id)],
    )


def tiny(seed=0, noise=0.1):
    return cut(chain(1, 3, seed, noise), 60)


def true_quadrics(problem):
    seen = np.unique(problem.recording.detections.object_id)
    return np.array(
        [_core.dual_quadric_from_ellipsoid(problem.truth.ellipsoids[row]) for row in seen]
    )


def measured(case, program, cpu, boxes=100, score=TRUE_ANSWER, peak=50.0):
    """Runs of the given CPU times, a fifth of it building, the wall clock twice as long."""
    runs = tuple(
        Run(
            {"build": Stage(0.4 * s, 0.2 * s), "solve": Stage(1.6 * s, 0.8 * s)},
            peak_mb=peak,
            iterations=10,
            cost=7.0,
            score=score,
        )
        for s in cpu
    )
    return Measured(case, program, {"poses": 9, "objects": 2, "boxes": boxes}, runs)


def results(*measured):
    return Results({"cores": "2"}, "0.1.0", 0, measured)


def cells(table, heading):
    return next(list(column.cells) for column in table.columns if column.header == heading)


# --- problems ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("case", "size"),
    [
        ("peer-1", (521, 10, 1825)),
        ("peer-9", (5321, 99, 22357)),
        ("peer-84", (50321, 1008, 236810)),
    ],
)
def test_sizes_are_those_published(case, size):
    problem = CASES[case].problem(seed=0)
    objects = np.unique(problem.recording.detections.object_id)
    boxes = problem.recording.detections
    assert (len(problem.truth.poses), len(objects), len(boxes)) == size
    assert problem.peer_centers.shape == (size[1], 3)
    assert (np.diff(boxes.pose) >= 0).all()


def test_loop_by_hand():
    poses = chain(2, 1, 0, 1.0).truth.poses
    np.testing.assert_allclose(poses[79], [19.75, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[80], [20.0, 0.0, np.pi / 2.0], atol=1e-12)
    np.testing.assert_allclose(poses[130], [20.0, 12.5, np.pi], atol=1e-12)
    np.testing.assert_allclose(poses[[260, 520], :2], np.zeros((2, 2)), atol=1e-12)
    np.testing.assert_allclose(poses[600, :2], [20.0, 0.0], atol=1e-12)  # the second area
    assert len(poses) == 1121


def test_a_seed_is_one_problem():
    first, again, other = (chain(1, 4, seed, 0.5) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.recording.detections.box, again.recording.detections.box)
    np.testing.assert_array_equal(first.peer_centers, again.peer_centers)
    assert not np.array_equal(first.truth.center, other.truth.center)


def test_noise_is_a_factor_on_odometry():
    errors = [
        chain(1, 2, 5, noise).recording.odometry.relative
        - chain(1, 2, 5, 1e-9).recording.odometry.relative
        for noise in (0.5, 1.0)
    ]
    np.testing.assert_allclose(errors[1], 2.0 * errors[0], atol=1e-9)
    is_turn = np.zeros(520, dtype=bool)
    is_turn[[79, 129, 209, 259, 339, 389, 469, 519]] = True
    assert errors[1][:, 0].std() == pytest.approx(0.02, rel=0.1)
    assert errors[1][~is_turn, 2].std() == pytest.approx(0.02, rel=0.1)
    assert 0.04 < errors[1][is_turn, 2].std() < 0.2


def test_covariance_is_along_the_axes_of_the_next_pose():
    odometry = chain(1, 2, 0, 1.0).recording.odometry
    turned = odometry.relative[0, 2]
    axes = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    np.testing.assert_allclose(
        odometry.covariance[0, :2, :2], axes.T @ np.diag([0.02**2, 0.005**2]) @ axes, atol=1e-15
    )
    assert odometry.covariance[0, 2, 2] == pytest.approx(0.02**2)
    assert odometry.covariance[79, 2, 2] == pytest.approx(0.1**2)


def test_boxes_are_those_of_sampled_ellipsoids_and_a_pixel_of_noise():
    problem = chain(1, 2, 0, 1.0)
    boxes, truth = problem.recording.detections, problem.truth
    errors = []
    for row in range(0, len(boxes), 10):
        center, axes, turn = _core.axes_from_ellipsoid(truth.ellipsoids[boxes.object_id[row]])
        np.testing.assert_allclose(axes, [0.5, 0.4, 0.3], rtol=1e-12)
        robot = se2_matrix(truth.poses[boxes.pose[row]])
        surface = ellipsoid_surface(center, axes, turn, count=100)
        errors.append(boxes.box[row] - bounding_box(problem.recording.camera, robot, surface))
    assert len(errors) > 30
    assert np.std(errors) == pytest.approx(BOX_SIGMA_PX, rel=0.2)
    assert abs(np.mean(errors)) < 0.2


def test_peers_start_near_the_truth():
    problem = chain(4, 10, 0, 1e-6)
    assert np.std(problem.peer_centers - problem.truth.center) == pytest.approx(0.3, rel=0.2)


def test_paper_has_ellipsoids_and_boxes_only():
    problem = paper(0, 1.0)
    assert len(problem.truth.poses) == 253
    assert problem.recording.positions is None
    assert problem.truth.ellipsoids.shape == (10, 9)
    half = paper(0, 0.5).recording.odometry
    whole = problem.recording.odometry
    np.testing.assert_allclose(half.covariance[:, 2, 2], 0.25 * whole.covariance[:, 2, 2])


def test_problem_survives_its_file(tmp_path):
    problem = tiny()
    save_problem(problem, tmp_path / "problem.npz")
    recording, centers = load_problem(tmp_path / "problem.npz")
    np.testing.assert_array_equal(centers, problem.peer_centers)
    np.testing.assert_array_equal(recording.detections.box, problem.recording.detections.box)
    np.testing.assert_array_equal(
        recording.odometry.covariance, problem.recording.odometry.covariance
    )
    with np.load(tmp_path / "problem.npz") as arrays:
        chained = arrays["camera_poses"][0]
        for step in arrays["camera_steps"]:
            chained = chained @ step
        np.testing.assert_allclose(chained, arrays["camera_poses"][-1], atol=1e-12)
        robot = se2_matrix(problem.recording.odometry.first_pose)
        np.testing.assert_allclose(
            arrays["camera_poses"][0], robot @ arrays["camera_in_robot"], atol=1e-12
        )


# --- programs ----------------------------------------------------------------------------------


def answer_of(program, problem, folder):
    save_problem(problem, folder / "problem.npz")
    program.main(str(folder / "problem.npz"), str(folder / "answer.npz"))
    return measure.read_answer(problem, folder / "answer.npz")


def test_programs_find_the_same_optimum(tmp_path):
    problem = tiny()
    ours, scipy = (answer_of(program, problem, tmp_path) for program in (run_dqslam, run_scipy))
    assert list(ours.stages) == ["build", "solve"]
    assert list(scipy.stages) == ["build", "start", "solve"]
    assert scipy.cost == pytest.approx(ours.cost, rel=1e-3)
    assert scipy.score.rmse_m == pytest.approx(ours.score.rmse_m, abs=0.01)
    assert ours.score.box_rms_px == pytest.approx(BOX_SIGMA_PX, rel=0.15)
    assert ours.score.impossible_boxes == 0
    assert ours.evaluation_seconds > 0.0
    assert scipy.evaluation_seconds is None


def test_residuals_in_numpy_are_those_of_the_core():
    graph = build_graph(tiny().recording, box_noise=BoxNoise(pixels=1.0, relative=0.0))
    estimate, summary = solve(graph)
    residuals = run_scipy.Residuals(graph)
    parameters = residuals.pack(estimate.poses, estimate.ellipsoids)
    error = residuals.stage(parameters, use_boxes=True)(parameters)
    assert 0.5 * error @ error == pytest.approx(summary.final_cost, rel=1e-9)
    poses, ellipsoids = residuals.unpack(parameters)
    np.testing.assert_array_equal(poses, estimate.poses)
    np.testing.assert_array_equal(ellipsoids, estimate.ellipsoids)


@pytest.mark.parametrize("use_boxes", [False, True])
def test_sparsity_holds_every_derivative(use_boxes):
    graph = build_graph(tiny().recording, box_noise=BoxNoise(pixels=1.0, relative=0.0))
    estimate, _ = solve(graph)
    residuals = run_scipy.Residuals(graph)
    parameters = residuals.pack(estimate.poses, estimate.ellipsoids)
    function = residuals.stage(parameters, use_boxes=use_boxes)
    steps = 1e-6 * np.eye(len(parameters))
    change = np.array([function(parameters + s) - function(parameters - s) for s in steps]).T
    jacobian = change / 2e-6
    allowed = residuals.sparsity().toarray() != 0.0
    assert allowed.shape == jacobian.shape
    assert np.abs(jacobian[~allowed]).max() < 1e-3
    assert np.abs(jacobian[allowed]).max() > 100.0


def test_split_of_a_core_that_tells():
    summary = types.SimpleNamespace(evaluation_seconds=0.5, linear_solver_seconds=0.25)
    assert run_dqslam.split(summary) == {
        "start_seconds": None,
        "evaluation_seconds": 0.5,
        "linear_solver_seconds": 0.25,
    }


@pytest.fixture
def run_gtsam(monkeypatch):
    """Give the module without the package, which is for another Python."""
    for name in ("gtsam", "gtsam_quadrics"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.delitem(sys.modules, "benchmarks.programs.run_gtsam", raising=False)
    return importlib.import_module("benchmarks.programs.run_gtsam")


def test_covariances_of_a_camera_that_looks_left(run_gtsam):
    """Its x points forward, y down, z to the left: heading turns about -y."""
    robot_from_camera = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    planar = np.diag([0.2**2, 0.005**2, 0.1**2])
    planar[0, 2] = planar[2, 0] = 0.003
    (found,) = run_gtsam.in_camera(planar[None], robot_from_camera)
    np.testing.assert_allclose(
        np.diag(found), [1e-6, 0.1**2, 1e-6, 0.2**2, 1e-6, 0.005**2], atol=1e-15
    )
    assert found[1, 3] == found[3, 1] == pytest.approx(-0.003)


def test_upper_triangles_by_hand(run_gtsam):
    matrix = np.array([[1, 2, 3, 4], [2, 5, 6, 7], [3, 6, 8, 9], [4, 7, 9, 1.0]])
    np.testing.assert_array_equal(
        run_gtsam.upper_triangles(-2.0 * matrix[None]), [[1, 2, 3, 4, 5, 6, 7, 8, 9]]
    )


@pytest.mark.skipif(
    not peers._VENV.is_dir(), reason="./run bench makes gtsam_quadrics' environment"
)
def test_gtsam_quadrics_finds_the_trajectory_too(tmp_path):
    problem = chain(1, 10, 0, 0.1)
    save_problem(problem, tmp_path / "problem.npz")
    command = peers.gtsam_command(lambda _: None)
    run = measure.run_once(
        command, problem, tmp_path / "problem.npz", tmp_path / "answer.npz", limit_s=60.0
    )
    assert run.failure == ""
    assert run.score.rmse_m < 0.05
    fitted = (3 * 520 + 9 * 10) / (4 * 1825)  # parameters take up that share of the noise
    assert run.score.box_rms_px == pytest.approx(np.sqrt(1.0 - fitted), rel=0.05)


def test_a_peer_without_its_python_is_missing(monkeypatch, tmp_path):
    monkeypatch.setattr(peers, "_VENV", measure.ROOT / "build" / "bench" / "none")
    monkeypatch.setattr(peers, "_candidates", lambda: iter([str(tmp_path / "python3.10")]))
    said = []
    with pytest.raises(peers.PeerMissingError, match=r"no python3\.10 .* DQSLAM_PYTHON310"):
        peers.gtsam_command(said.append)
    assert said == ["installing gtsam_quadrics==0.3.0 into build/bench/none"]


# --- scores ------------------------------------------------------------------------------------


def test_score_of_the_truth():
    problem = tiny()
    found = score(problem, problem.truth.poses, true_quadrics(problem))
    assert (found.rmse_m, found.aligned_rmse_m) == (0.0, pytest.approx(0.0, abs=1e-12))
    assert found.center_rmse_m == pytest.approx(0.0, abs=1e-12)
    assert found.box_rms_px == pytest.approx(BOX_SIGMA_PX, rel=0.15)
    assert found.impossible_boxes == 0


def test_score_by_hand():
    problem = tiny()
    poses, quadrics = problem.truth.poses.copy(), true_quadrics(problem)
    poses[:, :2] += [3.0, 4.0]
    quadrics[0, [0, 4, 7]] += 100.0  # no ellipsoid any more
    first = problem.recording.detections.object_id == 0
    found = score(problem, poses, quadrics)
    assert found.rmse_m == pytest.approx(5.0)
    assert found.aligned_rmse_m == pytest.approx(0.0, abs=1e-9)
    assert found.impossible_boxes >= first.sum() > 0


def test_an_answer_of_another_size_is_refused():
    problem = tiny()
    with pytest.raises(ValueError, match=r"expected 60 poses and \d objects, got 59 and \d"):
        score(problem, problem.truth.poses[1:], true_quadrics(problem))


# --- processes ---------------------------------------------------------------------------------


def test_programs_take_turns_and_one_that_fails_is_not_repeated(tmp_path):
    problem = tiny()
    stopwatch = Stopwatch()
    with stopwatch("solve"):
        pass
    prepared = tmp_path / "prepared.npz"
    write_answer(
        str(prepared),
        problem.truth.poses,
        true_quadrics(problem),
        stopwatch,
        iterations=3,
        cost=2.5,
    )
    copies = [
        sys.executable,
        "-c",
        f"import shutil, sys; shutil.copy({str(prepared)!r}, sys.argv[2])",
    ]
    fails = [sys.executable, "-c", "raise SystemExit('no such luck')"]
    said = []
    good, bad = measure.measure(
        "tiny",
        problem,
        {"good": copies, "bad": fails},
        repeat=2,
        limit_s=60.0,
        progress=said.append,
    )
    assert said == ["tiny: good, run 1 of 2", "tiny: bad, run 1 of 2", "tiny: good, run 2 of 2"]
    assert good.failure == ""
    assert [(run.iterations, run.cost, run.score.rmse_m) for run in good.runs] == [
        (3, 2.5, 0.0)
    ] * 2
    assert bad.failure == "no such luck"
    assert good.size == {
        "poses": 60,
        "objects": len(true_quadrics(problem)),
        "boxes": good.size["boxes"],
    }


def test_a_run_over_the_limit_fails(tmp_path):
    sleeps = [sys.executable, "-c", "import time; time.sleep(60)"]
    run = measure.run_once(sleeps, tiny(), tmp_path / "problem", tmp_path / "answer", limit_s=0.2)
    assert run.failure == "not done within 0.2 s"


def test_peak_memory_sees_an_array():
    before = peak_memory_mb()
    held = np.ones(20_000_000)
    assert peak_memory_mb() >= before
    assert peak_memory_mb() > held.nbytes / 2**20


def test_stopwatch_adds_up():
    stopwatch = Stopwatch()
    for _ in range(2):
        with stopwatch("solve"):
            pass
    assert list(stopwatch.stages) == ["solve"]
    assert stopwatch.stages["solve"]["wall_s"] > 0.0


# --- results -----------------------------------------------------------------------------------


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
    headings = ("boxes", "RMSE m", "aligned m", "centres m", "boxes px", "impossible", "cost")
    assert [cells(table, heading)[0] for heading in headings] == [
        *("100", "0.1", "0.02", "0.05", "1", "0", "7"),
    ]


# --- comparison --------------------------------------------------------------------------------


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
    assert cells(report.linearised_table([found]), "CPU ns (least, greatest)") == ["750 (700, 800)"]


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


# --- command line ------------------------------------------------------------------------------


def in_one_line(result):
    """Undo the frame and the line breaks around a message."""
    return " ".join(result.output.replace("│", " ").split())


@pytest.fixture
def app(monkeypatch):
    """Give the command with a tiny case, solved in this process."""
    case = Case(lambda seed, noise: tiny(seed, noise), noise=0.1)
    monkeypatch.setitem(CASES, "tiny", case)
    programs = {"dqslam": run_dqslam, "scipy": run_scipy}

    def in_place(command, problem, given, answer, limit_s):
        programs[command[-1].rpartition("run_")[2]].main(str(given), str(answer))
        return measure.read_answer(problem, answer)

    monkeypatch.setattr(measure, "run_once", in_place)
    application = typer.Typer()
    application.command()(command_line.bench)
    return application


def test_bench_writes_results_that_compare_with_themselves(app, tmp_path):
    options = ["tiny", "--repeat", "2", "--programs", "dqslam", "--out", str(tmp_path)]
    first = CliRunner().invoke(app, options)
    assert first.exit_code == 0, first.output
    written = load_results(tmp_path / "bench.json")
    assert written.measured[0].size["poses"] == 60
    assert len(written.measured[0].runs) == 2
    costs = {run.cost for run in written.measured[0].runs}
    assert len(costs) == 1
    worst = replace(written, measured=(replace(written.measured[0], runs=(Run(failure="no"),)),))
    save_results(worst, tmp_path / "then.json")
    compared = CliRunner().invoke(app, [*options, "--compare", str(tmp_path / "then.json")])
    assert compared.exit_code == 0, compared.output


def test_a_broken_baseline_is_refused(app, tmp_path):
    (tmp_path / "then.json").write_text("{}", encoding="utf-8")
    refused = CliRunner().invoke(app, ["tiny", "--compare", str(tmp_path / "then.json")])
    assert refused.exit_code == 2
    assert "Field required" in in_one_line(refused)


@pytest.mark.parametrize(
    ("options", "message"),
    [(["peer-2"], "no case 'peer-2'"), (["tiny", "--programs", "ceres"], "no program 'ceres'")],
)
def test_unknown_names_are_refused(app, options, message):
    refused = CliRunner().invoke(app, options)
    assert refused.exit_code == 2
    assert message in in_one_line(refused)
