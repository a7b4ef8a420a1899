"""The estimate of one track: gradients, evidence and covariances against dense computations."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import Camera, _core
from dqslam.tracks.body import Views, predict_boxes
from dqslam.tracks.fit import (
    covariance,
    evidence_with_path,
    fit_track,
    with_information,
)
from dqslam.tracks.motion import HEADING, SPEED, VEHICLE
from dqslam.tracks.problem import TrackProblem, Trajectory, linearize
from dqslam.tracks.sizes import body_size

CAMERA = Camera(700.0, 700.0, 620.0, 187.0, 1242, 375)
AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
COUNT = 8
MOVES = np.ones(COUNT - 1, dtype=bool)


def oncoming(noise_px=0.0, seed=0):
    """A car that comes at 10 m/s along y = 3, seen by a camera at rest, 1.6 m above the ground."""
    state = np.zeros((COUNT, 6))
    state[:, 0], state[:, 1] = 40.0 - np.arange(COUNT), 3.0
    state[:, HEADING], state[:, SPEED] = np.pi, 10.0
    size = body_size("car")
    views = Views(CAMERA, np.tile(AHEAD, (COUNT, 1, 1)), np.tile([0.0, 0.0, 1.6], (COUNT, 1)))
    foot = np.column_stack([state[:, :2], np.zeros(COUNT)])
    box = predict_boxes(views, foot, state[:, HEADING], np.exp(size.log_half))
    box += noise_px * np.random.default_rng(seed).normal(size=box.shape)
    problem = TrackProblem(
        views,
        0.1 * np.arange(COUNT),
        box,
        np.ones((COUNT, 4)),
        np.zeros((COUNT, 4), dtype=bool),
        np.zeros((COUNT, 3)),
        np.full(COUNT, 0.1),
        size,
        VEHICLE,
    )
    return problem, Trajectory(state, size.log_half)


def moved(at, change):
    return Trajectory(at.state + change[:-3].reshape(-1, 6), at.log_half + change[-3:])


def test_the_truth_is_the_estimate_of_boxes_without_noise():
    problem, truth = oncoming()
    random = np.random.default_rng(1)
    start = moved(truth, 0.1 * random.normal(size=6 * COUNT + 3))
    fit = fit_track(problem, start, MOVES)
    assert fit.converged
    # The prior of the speed, 0 with 12 m/s, makes it a little slower and nearer.
    np.testing.assert_allclose(fit.trajectory.state[:, :2], truth.state[:, :2], atol=0.12)
    np.testing.assert_allclose(fit.trajectory.state[:, SPEED], 10.0, atol=0.25)
    np.testing.assert_allclose(fit.trajectory.log_half, truth.log_half, atol=0.01)


def test_the_gradient_is_that_of_the_cost():
    problem, truth = oncoming(noise_px=1.0)
    random, e = np.random.default_rng(2), 1e-6
    at = moved(truth, 0.05 * random.normal(size=6 * COUNT + 3))
    first = truth.state[0]
    equations = linearize(problem, at, MOVES, first)
    found = np.append(equations.gradient.ravel(), equations.gradient_size)
    for place in range(len(found)):
        step = e * np.eye(len(found))[place]
        costs = [linearize(problem, moved(at, s * step), MOVES, first).cost for s in (1, -1)]
        assert found[place] == pytest.approx((costs[0] - costs[1]) / (2 * e), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("moves", [MOVES, ~MOVES])
def test_derivatives_by_cameras_that_the_ground_follows_are_small_differences(moves):
    problem, truth = oncoming(noise_px=1.0)
    plane = np.tile([0.1, 0.02, -0.03], (COUNT, 1))
    problem = replace(problem, plane=plane, ground_follows=True)
    random, e = np.random.default_rng(3), 1e-6
    at = moved(truth, 0.02 * random.normal(size=6 * COUNT + 3))
    first = truth.state[0]
    equations = linearize(problem, at, moves, first)
    for place in range(0, 6 * COUNT, 5):
        step = (e * np.eye(6 * COUNT)[place]).reshape(-1, 6)
        costs = [linearize(problem.moved(s * step), at, moves, first).cost for s in (1, -1)]
        expected = (costs[0] - costs[1]) / (2 * e)
        found = equations.gradient_camera.ravel()[place]
        assert found == pytest.approx(expected, rel=1e-3, abs=0.05)


def test_a_world_that_turns_as_a_whole_turns_tracks_and_leaves_speeds():
    """All cameras turn about the origin by 1 mrad, the ground with them: so does the thing."""
    problem, truth = oncoming()
    views, turn = problem.views, np.array([0.0, 1e-3, 0.0])
    axes = views.rotation.transpose(0, 2, 1)
    shift = np.einsum("nij,nj->ni", axes, np.cross(turn, views.position))
    motion = np.concatenate([shift, axes @ turn], axis=1).ravel()
    change = {}
    for follows in (True, False):
        fit = fit_track(replace(problem, ground_follows=follows), truth, MOVES)
        change[follows] = (covariance(fit.equations)[1] @ motion)[:-3].reshape(-1, 6)
    # It stays upright, which is what is left.
    assert np.abs(change[True][:, SPEED]).max() < 0.005
    assert np.abs(change[True][:, :2]).max() < 0.06
    assert np.abs(change[False][:, SPEED]).max() > 0.02


def dense(equations):
    """The normal equations as one matrix."""
    full = np.zeros((6 * COUNT + 3, 6 * COUNT + 3))
    for row in range(COUNT):
        own = slice(6 * row, 6 * row + 6)
        full[own, own] = equations.diagonal[row]
        full[own, -3:], full[-3:, own] = equations.border[row], equations.border[row].T
        if row:
            before = slice(6 * row - 6, 6 * row)
            full[own, before] = equations.below[row - 1]
            full[before, own] = equations.below[row - 1].T
    full[-3:, -3:] = equations.corner
    return full


def test_covariance_and_evidence_are_those_of_the_dense_equations():
    problem, truth = oncoming(noise_px=1.0)
    fit = fit_track(problem, truth, MOVES)
    full = dense(fit.equations)
    spread, by_camera = covariance(fit.equations)
    np.testing.assert_allclose(spread @ full, np.eye(len(full)), atol=1e-6)
    expected = fit.equations.log_density - fit.equations.cost
    expected -= 0.5 * np.linalg.slogdet(full)[1]
    assert fit.log_evidence == pytest.approx(expected)
    # All cameras 1 m farther ahead see the same if the track is 1 m farther ahead, too.
    ahead = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], COUNT)
    change = (by_camera @ ahead)[:-3].reshape(-1, 6)
    np.testing.assert_allclose(change[:, 0], 1.0, atol=0.02)
    np.testing.assert_allclose(change[:, 1:], 0.0, atol=0.02)


def test_a_path_that_is_exact_adds_no_evidence_and_one_that_errs_explains_a_creep():
    """A car at rest whose camera is believed at rest, but was moved sideways by 2 cm an image."""
    problem, truth = oncoming()
    state = np.tile(truth.state[:1], (COUNT, 1))
    state[:, SPEED] = 0.0
    shifted = replace(
        problem.views,
        position=problem.views.position + 0.02 * np.arange(COUNT)[:, None] * [0, 1, 0],
    )
    foot = np.column_stack([state[:, :2], np.zeros(COUNT)])
    box = predict_boxes(shifted, foot, state[:, HEADING], np.exp(truth.log_half))
    crept = replace(problem, box=box)
    fit = fit_track(crept, Trajectory(state, truth.log_half), ~MOVES)
    none = np.zeros((6 * COUNT, 6 * COUNT))
    assert evidence_with_path(crept, fit, ~MOVES, none) == pytest.approx(fit.log_evidence, abs=1e-3)
    steps = np.tril(np.ones((COUNT, COUNT)))
    walk = np.kron(steps @ steps.T, np.diag([0.02**2] * 3 + [1e-8] * 3))
    assert evidence_with_path(crept, fit, ~MOVES, walk) > fit.log_evidence + 0.5
    exact = fit_track(problem, truth, MOVES)
    assert evidence_with_path(problem, exact, MOVES, walk) < exact.log_evidence


def test_the_evidence_of_a_path_that_errs_a_little_is_that_of_a_normal():
    """With small P: half of g^T (1 + P M)^-1 P g less that of log |1 + P M|, M by differences."""
    problem, truth = oncoming(noise_px=0.5)
    fit = fit_track(problem, truth, MOVES)
    size, e = 6 * COUNT, 1e-4
    gradient = fit.equations.gradient_camera.ravel()
    one = np.zeros(size)
    one[[0, 6, 13]] = 1.0, -0.5, 0.7
    path = 1e-4 * np.outer(one, one)  # all cameras move by one random number
    costs = [
        fit_track(problem.moved((s * e * one).reshape(-1, 6)), fit.trajectory, MOVES).equations.cost
        for s in (1.0, 0.0, -1.0)
    ]
    curvature = (costs[0] - 2.0 * costs[1] + costs[2]) / e**2
    slope, variance = gradient @ one, 1e-4
    both = 1.0 + variance * curvature
    expected = 0.5 * variance * slope**2 / both - 0.5 * np.log(both)
    found = evidence_with_path(problem, fit, MOVES, path) - fit.log_evidence
    assert found == pytest.approx(expected, abs=0.02)


def test_a_path_far_off_is_moved_to_where_a_thing_rests():
    """Cameras that look up and down by 8 px make boxes jump. Boxes have 1 px."""
    problem, truth = oncoming()
    pitch = 8.0 / CAMERA.fy * np.array([0.0, 1.0, -1.0, 1.0, 0.0, -1.0, 1.0, 0.0])
    motion = np.zeros((COUNT, 6))
    motion[:, 3] = pitch
    state = np.tile(truth.state[:1], (COUNT, 1))
    state[:, SPEED] = 0.0
    seen = problem.moved(motion).views
    foot = np.column_stack([state[:, :2], np.zeros(COUNT)])
    box = predict_boxes(seen, foot, state[:, HEADING], np.exp(truth.log_half))
    jumping = replace(problem, box=box)
    fit = fit_track(jumping, Trajectory(state, truth.log_half), ~MOVES)
    assert fit.equations.cost > 40.0
    path = np.kron(np.eye(COUNT), np.diag([1e-8] * 3 + [(8.0 / CAMERA.fy) ** 2, 1e-8, 1e-8]))
    # What is left is less than the cost of the pitches themselves, six of one sigma.
    volume = fit.log_evidence + fit.equations.cost
    assert evidence_with_path(jumping, fit, ~MOVES, path) > volume - 30.0
    assert fit.log_evidence < volume - 40.0


def test_boxes_tell_four_fifths_of_what_the_weights_of_a_robust_loss_say():
    problem, truth = oncoming(noise_px=1.0)
    fit = fit_track(problem, truth, MOVES)
    whole, told = fit.equations, with_information(problem, fit, MOVES)
    share = _core.SHARE_OF_INFORMATION
    assert share == 0.8
    np.testing.assert_allclose(told.of_boxes, share * whole.of_boxes, rtol=1e-9)
    np.testing.assert_allclose(told.below, whole.below)
    prior = problem.size.precision
    expected = prior + share * (whole.corner - prior)
    np.testing.assert_allclose(told.corner, expected)


def test_a_start_behind_the_camera_has_no_estimate():
    problem, truth = oncoming()
    state = truth.state.copy()
    state[:, 0] = -40.0
    assert fit_track(problem, Trajectory(state, truth.log_half), MOVES) is None


def test_edges_that_are_cut_bound_from_one_side():
    """An edge cut 30 px inside of the outline costs nothing, one that ends 30 px outside does."""
    problem, truth = oncoming()
    costs = []
    for shift in (0.0, 30.0, -30.0):  # of u_min
        box, cut = problem.box.copy(), problem.truncated.copy()
        box[0, 0], cut[0, 0] = box[0, 0] + shift, True
        changed = replace(problem, box=box, truncated=cut)
        costs.append(linearize(changed, truth, MOVES, truth.state[0]).cost)
    assert costs[0] == pytest.approx(costs[1])
    assert costs[2] > costs[0] + 10.0


def test_states_and_moves_that_do_not_fit_the_boxes_are_refused():
    problem, truth = oncoming()
    with pytest.raises(ValueError, match="a state for each"):
        fit_track(problem, Trajectory(truth.state[1:], truth.log_half), MOVES)
    with pytest.raises(ValueError, match="a state for each"):
        fit_track(problem, truth, MOVES[1:])
    with pytest.raises(ValueError, match="a row for each image"):
        replace(problem, box=problem.box[1:]).core  # noqa: B018


def test_a_right_side_has_a_row_for_each_unknown():
    problem, truth = oncoming()
    equations = linearize(problem, truth, MOVES, truth.state[0])
    with pytest.raises(ValueError, match="a row for each unknown"):
        equations.solve(np.zeros((6 * COUNT, 1)))
