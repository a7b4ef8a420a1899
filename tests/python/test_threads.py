"""The solver in several threads: the same result, bit for bit."""

import json

import numpy as np
import pytest
from benchmarks.problems import NOISE, SIZES, chain

import dqslam as dq
from dqslam.pipeline import RunOptions


def results(graph):
    for threads in (1, 2, 3):
        estimate, summary = dq.solve(graph, dq.SolveOptions(threads=threads))
        yield estimate, summary


def assert_same_bits(graph):
    (first, its_summary), *others = results(graph)
    for estimate, summary in others:
        np.testing.assert_array_equal(estimate.poses, first.poses)
        np.testing.assert_array_equal(estimate.ellipsoids, first.ellipsoids)
        np.testing.assert_array_equal(estimate.inliers, first.inliers)
        assert summary.final_cost == its_summary.final_cost
        assert summary.iterations == its_summary.iterations
    return first


def test_a_drive_of_the_paper():
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    assert_same_bits(dq.build_graph(recording))


def test_a_chain_whose_parts_are_solved_at_the_same_time():
    problem = chain(3, 11, 0, 0.1)
    assert len(problem.recording.detections.box) > 4096  # less is one part
    graph = dq.build_graph(problem.recording, box_noise=NOISE, size_prior=SIZES)
    estimate = assert_same_bits(graph)
    error = np.linalg.norm(estimate.poses[:, :2] - problem.truth.poses[:, :2], axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.1


@pytest.mark.parametrize("threads", [0, -1])
def test_fewer_than_one_thread_are_refused(threads):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    with pytest.raises(ValueError, match="threads must be positive"):
        dq.solve(dq.build_graph(recording), dq.SolveOptions(threads=threads))


def test_a_run_hands_them_to_the_solver():
    assert RunOptions(threads=3).solve_options().threads == 3
    assert RunOptions().solve_options().threads == 1


def test_results_do_not_tell_the_number(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    options = dq.SolveOptions(threads=2)
    estimate, _ = dq.solve(graph, options)
    dq.save_estimate(estimate, tmp_path / "two", graph=graph, options=options)
    with np.load(tmp_path / "two" / "graph.npz") as arrays:
        settings = json.loads(str(arrays["settings"]))
    assert settings["options"]["max_iterations"] == options.max_iterations
    assert "threads" not in settings["options"]
