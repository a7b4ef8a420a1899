"""Absolute positions and loop closures in a problem: better, honest, and refused where useless."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.uncertainty import normalized_squares

COVARIANCE = np.array([[9e-4, 3e-4, 0.0], [3e-4, 25e-4, 2e-4], [0.0, 2e-4, 16e-4]])
FRAMES = {
    "paper": np.array([100.0, -50.0, 2.0]),
    "orbit": np.array([100.0, -50.0, 7.0, 0.0, 0.6, 0.0, 0.8]),
}


def problem(name, seed):
    recording, truth = dq.simulate(dq.load_scenario(name), seed=seed)
    return recording, truth, dq.build_graph(recording, box_noise=dq.BoxNoise(1.0, 0.02))


def measured(truth, frame, seed, every=5):
    """Positions of some true poses in another frame, and all true poses there."""
    model, count = truth.pose_model, len(truth.poses)
    there = _core.compose(model, np.tile(frame, (count, 1)), truth.poses)
    rows = np.arange(0, count, every)
    size = 2 if len(frame) == 3 else 3
    position = np.zeros((len(rows), 3))
    position[:, :size] = there[rows, :size]
    noise = np.random.default_rng(seed).multivariate_normal(np.zeros(3), COVARIANCE, len(rows))
    covariance = np.tile(COVARIANCE, (len(rows), 1, 1))
    return dq.AbsolutePositions(rows, position + noise, covariance), there


@pytest.mark.parametrize("name", FRAMES)
def test_positions_give_the_path_in_their_frame_with_honest_covariances(name):
    nees, ends, before = [], [], []
    for seed in range(5):
        recording, truth, graph = problem(name, seed)
        absolute, there = measured(truth, FRAMES[name], seed)
        estimate, marginals, summary = dq.solve_with_absolute_positions(graph, absolute)
        assert summary.converged
        assert len(estimate.poses) == len(estimate.timestamps) == len(there)
        size = 2 if name == "paper" else 3
        off = np.linalg.norm(estimate.poses[:, :size] - there[:, :size], axis=1)
        ends.append(off.mean())
        alone, _ = dq.solve(graph)
        before.append(np.linalg.norm(alone.poses[:, :size] - truth.poses[:, :size], axis=1).mean())
        errors = _core.minus(truth.pose_model, there, estimate.poses)
        nees.append(normalized_squares(errors, marginals.poses).mean())
        assert np.isfinite(marginals.poses).all()
    # 51 or 30 positions of 3 to 5 cm each, and boxes and odometry between them.
    assert max(ends) < 0.05
    if name == "paper":  # an open path drifts away from its first pose, which is exact there
        assert np.mean(ends) < 0.5 * np.mean(before)
    assert 0.3 < np.mean(nees) < 2.0


def test_the_objects_move_with_the_frame():
    recording, truth, graph = problem("orbit", 0)
    absolute, _ = measured(truth, FRAMES["orbit"], 0)
    estimate, _, _ = dq.solve_with_absolute_positions(graph, absolute)
    seen = np.isin(truth.object_ids, estimate.object_ids)
    centers = np.column_stack([truth.centers[seen], np.zeros((seen.sum(), 3)), np.ones(seen.sum())])
    frame = np.tile(FRAMES["orbit"], (len(centers), 1))
    expected = _core.compose(dq.PoseModel.SE3, frame, centers)[:, :3]
    assert np.linalg.norm(estimate.centers - expected, axis=1).max() < 0.05
    plain, _ = dq.solve(graph)
    np.testing.assert_allclose(estimate.initial_poses[0], estimate.poses[0], atol=1e-12)
    path = estimate.initial_poses
    steps = _core.between(graph.core.pose_model, path[:-1], path[1:])
    np.testing.assert_allclose(steps, recording.odometry.relative, atol=1e-9)
    np.testing.assert_allclose(estimate.semi_axes, plain.semi_axes, rtol=0.1)


def test_what_does_not_determine_the_frame_is_refused():
    recording, truth, graph = problem("orbit", 0)
    absolute, _ = measured(truth, FRAMES["orbit"], 0)
    line = replace(absolute, position=np.outer(np.arange(len(absolute)), [1.0, 2.0, 3.0]))
    with pytest.raises(ValueError, match="absolute: the positions lie on a line, and do not"):
        dq.solve_with_absolute_positions(graph, line)
    two = dq.AbsolutePositions([0, 9], absolute.position[:2], absolute.covariance[:2])
    with pytest.raises(ValueError, match="absolute: 2 positions, at least 3 are needed"):
        dq.solve_with_absolute_positions(graph, two)
    with pytest.raises(ValueError, match=r"absolute.pose row 0: no such pose \(there are 150\)"):
        dq.solve_with_absolute_positions(graph, replace(absolute, pose=absolute.pose + 900))
    upright = dq.build_graph(recording, scene_priors=dq.ScenePriors(upright_sigma=0.1))
    with pytest.raises(ValueError, match="scene_priors: they are of another frame"):
        dq.solve_with_absolute_positions(upright, absolute)
    with pytest.raises(ValueError, match=r"absolute: solve_with_absolute_positions\(graph"):
        dq.build_graph(replace(recording, absolute=absolute))
    _, truth, plane = problem("paper", 0)
    near = dq.AbsolutePositions([0, 1], np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)))
    with pytest.raises(ValueError, match="absolute: the positions lie near to each other"):
        dq.solve_with_absolute_positions(plane, near)


def closures_of(truth, sigma, seed, apart=60):
    model, rng = truth.pose_model, np.random.default_rng(seed)
    first = np.arange(0, len(truth.poses) - apart, 20)
    second = first + apart
    back = np.arange(len(first)) % 2 == 1
    start, end = np.where(back, second, first), np.where(back, first, second)
    relative = _core.between(model, truth.poses[start], truth.poses[end])
    covariance = np.diag(np.square(sigma))
    noise = rng.multivariate_normal(np.zeros(len(sigma)), covariance, len(first))
    covariances = np.tile(covariance, (len(first), 1, 1))
    return dq.LoopClosures(start, end, _core.plus(model, relative, noise), covariances)


def test_closures_improve_the_path_with_honest_covariances():
    before, after, nees = [], [], []
    for seed in range(6):
        recording, truth, graph = problem("paper", seed)
        closures = closures_of(truth, [0.02, 0.05, 0.004], seed)
        closed = dq.build_graph(
            replace(recording, closures=closures), box_noise=dq.BoxNoise(1.0, 0.02)
        )
        for one, errors in ((graph, before), (closed, after)):
            estimate, summary = dq.solve(one)
            off = estimate.poses[:, :2] - truth.poses[:, :2]
            errors.append(np.linalg.norm(off, axis=1).mean())
        assert summary.converged
        marginals = dq.marginal_covariances(closed, estimate)
        errors = _core.minus(truth.pose_model, truth.poses, estimate.poses)[1:]
        nees.append(normalized_squares(errors, marginals.poses[1:]).mean())
    assert np.mean(after) < 0.6 * np.mean(before)
    assert 0.4 < np.mean(nees) < 2.0


@pytest.mark.parametrize("name", ["paper", "orbit"])
def test_a_closure_is_laid_out_back_in_time_with_its_covariance(name):
    recording, truth, _ = problem(name, 0)
    model = truth.pose_model
    k = 3 if name == "paper" else 6
    root = np.random.default_rng(0).normal(size=(k, k))
    covariance = root @ root.T + np.eye(k)
    relative = _core.between(model, truth.poses[[3]], truth.poses[[90]])
    steps = len(truth.poses) - 1
    tables = []
    for ends in ((3, 90), (90, 3)):
        closures = dq.LoopClosures([ends[0]], [ends[1]], relative, covariance[None])
        table = dq.build_graph(replace(recording, closures=closures)).core.odometry
        assert (table.from_pose[steps], table.to_pose[steps]) == (90, 3)
        tables.append(table)
    np.testing.assert_allclose(tables[1].relative[steps], relative[0])
    np.testing.assert_allclose(tables[1].covariance[steps].reshape(k, k), covariance)
    inverse = _core.inverse(model, relative)
    np.testing.assert_allclose(tables[0].relative[steps], inverse[0])
    # The covariance of the inverse, by differences.
    moved = [
        _core.minus(model, _core.inverse(model, _core.plus(model, relative, step[None])), inverse)
        for step in 1e-6 * np.eye(k)
    ]
    jacobian = np.concatenate(moved).T / 1e-6
    expected = jacobian @ covariance @ jacobian.T
    np.testing.assert_allclose(
        tables[0].covariance[steps].reshape(k, k), expected, rtol=1e-4, atol=1e-4
    )


def test_wrong_measurements_name_array_and_row():
    recording, truth, _ = problem("orbit", 0)
    one = np.array([[0, 0, 0, 0, 0, 0, 1.0]])
    with pytest.raises(ValueError, match="closures.to_pose row 0: a pose closes with itself"):
        dq.LoopClosures([3], [3], one, np.eye(6)[None])
    with pytest.raises(ValueError, match="closures.covariance row 0: covariance is not positive"):
        dq.LoopClosures([3], [4], one, -np.eye(6)[None])
    far = dq.LoopClosures([3], [400], one, np.eye(6)[None])
    with pytest.raises(ValueError, match=r"closures.to_pose row 0: no such pose \(there are 150"):
        replace(recording, closures=far)
    absolute = dq.AbsolutePositions([150], [[0, 0, 0]], np.eye(3)[None])
    with pytest.raises(ValueError, match="absolute.pose row 0: no such pose"):
        replace(recording, absolute=absolute)
    both = replace(recording, closures=dq.LoopClosures([3], [4], one, np.eye(6)[None]))
    assert repr(both).endswith(", 1 closure)")
