"""When a thing begins to move: all likely times, their weights, and their moments together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dqslam.tracks.body import Views, predict_boxes
from dqslam.tracks.fit import covariance, fit_track, with_information
from dqslam.tracks.judge import judge
from dqslam.tracks.mixture import mixed
from dqslam.tracks.motion import ABOVE, HEADING, SPEED, X, Y
from dqslam.tracks.problem import Trajectory
from dqslam.tracks.switches import Explanation, explain_with_rests
from test_tracks_fit import AHEAD, oncoming

COUNT, BEGINS = 24, 12


def leaving(noise_px=0.0):
    """A car that is parked 15 m ahead, and leaves with 2 m/s^2 from an image on."""
    small, truth = oncoming()
    seconds = 0.1 * np.arange(COUNT)
    gone = np.maximum(seconds - seconds[BEGINS], 0.0)
    state = np.zeros((COUNT, 6))
    state[:, X], state[:, Y], state[:, SPEED] = 15.0 + gone**2, 3.0, 2.0 * gone
    position = np.tile([0.0, 0.0, 1.6], (COUNT, 1))
    views = Views(small.views.camera, np.tile(AHEAD, (COUNT, 1, 1)), position)
    foot = np.column_stack([state[:, :2], np.zeros(COUNT)])
    box = predict_boxes(views, foot, state[:, HEADING], np.exp(truth.log_half))
    box += noise_px * np.random.default_rng(0).normal(size=box.shape)
    problem = replace(
        small,
        views=views,
        seconds=seconds,
        box=box,
        variance=np.ones((COUNT, 4)),
        truncated=np.zeros((COUNT, 4), dtype=bool),
        plane=np.zeros((COUNT, 3)),
        above=np.full(COUNT, 0.1),
    )
    return problem, Trajectory(state, truth.log_half)


def test_a_start_is_uncertain_by_some_images_and_the_true_one_is_among_them():
    problem, truth = leaving(noise_px=1.0)
    moving = fit_track(problem, truth, np.ones(COUNT - 1, dtype=bool))
    ways = explain_with_rests(problem, moving)
    log_evidence = np.array([way.log_evidence for way in ways])
    assert (np.diff(log_evidence) <= 0.0).all()
    begins = [int(np.flatnonzero(way.moves)[0]) for way in ways if np.diff(way.moves).sum() == 1]
    assert len(begins) == len(set(begins)) >= 3
    assert min(begins) <= BEGINS <= max(begins)
    # From the likeliest on, none is left out.
    assert sorted(begins) == list(range(min(begins), max(begins) + 1))


def test_a_judgment_has_all_explanations_of_the_motion():
    problem, _ = leaving(noise_px=1.0)
    judged = judge(problem)
    assert judged.behavior == "stops and goes" and judged.probability["rests"] < 1e-3
    assert judged.weights.sum() == pytest.approx(1.0)
    assert (np.diff(judged.weights) <= 0.0).all()
    whole = [way.moves.all() for way in judged.explanations]
    moves = judged.weights[whole].sum()
    total = judged.probability["moves"] + judged.probability["stops and goes"]
    assert moves == pytest.approx(judged.probability["moves"] / total)


def test_moments_of_two_explanations_are_those_of_a_mixture():
    """Twice the same fit, one 1 m ahead and 0.5 m/s faster, with weights of 3 and 1."""
    problem, truth = oncoming(noise_px=1.0)
    moves = np.ones(len(truth.state) - 1, dtype=bool)
    fit = fit_track(problem, truth, moves)
    shifted = fit.trajectory.state.copy()
    shifted[:, X] += 1.0
    shifted[:, SPEED] += 0.5
    shifted[:, HEADING] += 2.0 * np.pi  # the same heading
    at = Trajectory(shifted, fit.trajectory.log_half)
    other = SimpleNamespace(trajectory=at, equations=fit.equations)
    ways = [
        (one, Explanation(one, moves, 0.0), weight) for one, weight in ((fit, 0.75), (other, 0.25))
    ]
    found = mixed(problem, ways, None)
    alone = [mixed(problem, ways[row : row + 1], None) for row in (0, 1)]
    np.testing.assert_allclose(found.state[:, X], fit.trajectory.state[:, X] + 0.25)
    np.testing.assert_allclose(found.state[:, HEADING], fit.trajectory.state[:, HEADING])
    within = 0.75 * alone[0].covariance + 0.25 * alone[1].covariance
    between = found.covariance - within
    np.testing.assert_allclose(between[:, X, X], 0.75 * 0.25 * 1.0, atol=1e-9)
    np.testing.assert_allclose(between[:, X, SPEED], 0.75 * 0.25 * 0.5, atol=1e-9)
    np.testing.assert_allclose(between[:, SPEED, SPEED], 0.75 * 0.25 * 0.25, atol=1e-9)
    np.testing.assert_allclose(between[:, ABOVE], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.moving, 1.0)


def test_what_is_unknown_of_the_path_adds_to_a_track():
    """All cameras may be 0.3 m farther ahead together: so may the thing."""
    problem, truth = oncoming(noise_px=1.0)
    moves = np.ones(len(truth.state) - 1, dtype=bool)
    fit = fit_track(problem, truth, moves)
    ways = [(fit, Explanation(fit, moves, 0.0), 1.0)]
    ahead = np.tile([0.0, 0.0, 0.3, 0.0, 0.0, 0.0], len(truth.state))
    alone, more = (mixed(problem, ways, path) for path in (None, np.outer(ahead, ahead)))
    added = more.covariance - alone.covariance
    np.testing.assert_allclose(added[:, X, X], 0.09, rtol=0.05)
    whole, _ = covariance(with_information(problem, fit, moves))
    np.testing.assert_allclose(alone.covariance[0, :6, :6], whole[:6, :6])
