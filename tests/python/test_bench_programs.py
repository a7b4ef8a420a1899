"""The programs that the benchmarks compare, at tiny sizes."""

import importlib
import sys
import types

import numpy as np
import pytest
from benchmarks import measure, peers
from benchmarks.files import save_problem
from benchmarks.problems import BOX_SIGMA_PX, chain
from benchmarks.programs import run_dqslam, run_scipy

from bench import tiny
from dqslam import BoxNoise, SizePrior, build_graph, solve


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
    graph = build_graph(tiny().recording, box_noise=BoxNoise(1.0, 0.0), size_prior=SizePrior())
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
    graph = build_graph(tiny().recording, box_noise=BoxNoise(1.0, 0.0), size_prior=SizePrior())
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
