"""Tracklets of one thing that a tracker has lost and found: joined where its motion predicts it.

Two tracklets are of one thing if one motion explains the boxes of both so much better than two do.
The marginal likelihoods of the three estimates tell: what goes on has no second place, heading,
speed and size to be explained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.tracks.candidates import Scene
from dqslam.tracks.fit import TrackFit, fit_from_afar, fit_track
from dqslam.tracks.motion import HEADING, SPEED, X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory
from dqslam.tracks.start import mirrored_start, moving_start, rough_places

# What is lost for longer [s] is taken for another thing.
LOST_FOR_S = 3.0
# Of each tracklet so many boxes tell, those next to the gap; two of them tell a speed.
_MOST_BOXES, _FEWEST_BOXES = 30, 2
# An estimate begins as if things were anywhere, with sigmas of so many meters and pi rad, as
# FirstSigmas() in cpp/dqslam/tracks/motion.h has it. But others of its class are likelier where
# one is already: about so far from it along and across its way [m], turned like it [rad], and as
# fast, as a share of the usual speed.
_ANYWHERE_M, _ALONG_M, _ACROSS_M, _TURNED, _AS_FAST = 100.0, 10.0, 3.0, 0.3, 0.3
_LOG_CROWD = float(np.log(_ANYWHERE_M**2 * np.pi / (_ALONG_M * _ACROSS_M * _TURNED * _AS_FAST)))
# Tracklets of one thing with this probability are joined.
_SURE = 0.99
# Those are compared of which the later one begins where the earlier one leads, up to an error of
# the distance, as a share of it, and one of the speed [m/s].
_OFF_SHARE, _OFF_SPEED = 0.3, 5.0


@dataclass(frozen=True, eq=False)
class _End:
    """The first or the last boxes of a tracklet, and their motion."""

    rows: Ints
    class_name: str
    problem: TrackProblem
    fit: TrackFit


def join_tracklets(scene: Scene, groups: Sequence[Ints]) -> list[Ints]:
    """Return groups of boxes with those of one thing joined, each where its first one was.

    Parameters
    ----------
    groups
        Rows of boxes (b,) of each tracklet, one an image, in order of time. Those of a class of
        unknown size, or of a single box, stay as they are.
    """
    begins = [_end(scene, rows[:_MOST_BOXES]) for rows in groups]
    ends = [
        begin if len(rows) <= _MOST_BOXES else _end(scene, rows[-_MOST_BOXES:])
        for rows, begin in zip(groups, begins, strict=True)
    ]
    gain = np.zeros((len(groups), len(groups)))
    for before, earlier in enumerate(ends):
        for after, later in enumerate(begins):
            if earlier is not None and later is not None and _may_go_on(earlier, later):
                gain[before, after] = _log_odds(scene, earlier, later)
    return _chains(groups, gain - float(np.log(_SURE / (1.0 - _SURE))))


def _end(scene: Scene, rows: Ints) -> _End | None:
    """Fit a motion to some boxes (b,) of a tracklet; None where that cannot be done."""
    class_name = scene.class_name(rows)
    size = scene.size(class_name)
    if size is None or len(rows) < _FEWEST_BOXES:
        return None
    problem = scene.problem(rows, size, class_name)
    moves = np.ones(len(rows) - 1, dtype=np.bool_)
    fit = fit_from_afar(problem, moving_start(problem, *rough_places(problem)), moves)
    if fit is None:
        return None
    other = fit_track(problem, mirrored_start(problem, fit.trajectory), moves)
    if other is not None and other.log_evidence > fit.log_evidence:
        fit = other
    return _End(rows, class_name, problem, fit)


def _may_go_on(earlier: _End, later: _End) -> bool:
    """Return whether a tracklet begins soon after another, and not far from where that leads."""
    gap = float(later.problem.seconds[0] - earlier.problem.seconds[-1])
    if not 0.0 < gap <= LOST_FOR_S or earlier.class_name != later.class_name:
        return False
    last, first = earlier.fit.trajectory.state[-1], later.fit.trajectory.state[0]
    way = np.array([np.cos(last[HEADING]), np.sin(last[HEADING])])
    off = first[X : Y + 1] - last[X : Y + 1] - gap * last[SPEED] * way
    distance = np.linalg.norm(first[X : Y + 1] - later.problem.views.position[0, :2])
    return bool(np.linalg.norm(off) < _OFF_SHARE * distance + _OFF_SPEED * gap)


def _log_odds(scene: Scene, earlier: _End, later: _End) -> float:
    """Return the log odds that two tracklets are of one thing."""
    rows = np.append(earlier.rows, later.rows)
    size = scene.size(earlier.class_name)
    assert size is not None  # ends of tracklets have one
    problem = scene.problem(rows, size, earlier.class_name)
    moves = np.ones(len(rows) - 1, dtype=np.bool_)
    both = fit_track(problem, _one_after_the_other(earlier.fit, later.fit), moves)
    if both is None:
        return -np.inf
    apart = earlier.fit.log_evidence + later.fit.log_evidence + _LOG_CROWD
    return float(both.log_evidence - apart)


def _one_after_the_other(earlier: TrackFit, later: TrackFit) -> Trajectory:
    """Start from two estimates, the later one turned to go on as the earlier one does.

    A cuboid looks the same from behind: one that goes ahead and one that backs are the same.
    """
    before, after = earlier.trajectory.state, later.trajectory.state.copy()
    half_turns = np.round((after[0, HEADING] - before[-1, HEADING]) / np.pi)
    after[:, HEADING] -= np.pi * half_turns
    if half_turns % 2:
        after[:, SPEED] *= -1.0
    log_half = 0.5 * (earlier.trajectory.log_half + later.trajectory.log_half)
    return Trajectory(np.concatenate([before, after]), log_half)


def _chains(groups: Sequence[Ints], gain: Floats) -> list[Ints]:
    """Join groups to chains of the largest sum of gains (g, g), of earlier ones and later ones.

    A gain that is not positive joins nothing.
    """
    from scipy.optimize import linear_sum_assignment

    earlier, later = linear_sum_assignment(np.maximum(gain, 0.0), maximize=True)
    chosen = gain[earlier, later] > 0.0
    follows = dict(zip(earlier[chosen].tolist(), later[chosen].tolist(), strict=True))
    chains: list[Ints] = []
    for first in range(len(groups)):
        if first in follows.values():
            continue
        chain = [first]
        while chain[-1] in follows:
            chain.append(follows[chain[-1]])
        chains.append(np.concatenate([groups[one] for one in chain]))
    return chains
