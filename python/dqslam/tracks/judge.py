"""Whether a thing rests, moves, or rests and moves in turn: by the evidence of each hypothesis.

All three are one model of motion; what rests has no speed, no turn rate and next to no noise. Their
marginal likelihoods, by Laplace's method, are compared: a motion that the boxes do not need costs
what it could have been otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.track import Behavior
from dqslam.tracks.fit import TrackFit, evidence_of_path, fit_track
from dqslam.tracks.motion import SPEED, X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory
from dqslam.tracks.start import (
    mirrored_start,
    moving_start,
    resting_starts,
    rough_places,
    stopping_start,
)

# What of things that are seen is at rest, moves, and does both, before their boxes say more.
PRIOR: dict[Behavior, float] = {"rests": 0.6, "moves": 0.3, "stops and goes": 0.1}
# A thing moves if it rests with at most this probability.
MOST_PROBABLY_RESTS = 0.01
# What is slower than one of these speeds [m/s] may be at rest.
SLOW = (0.3, 0.6, 1.0, 2.0)
# It rests in part only if it is so slow there, as a share of its highest speed.
MAY_REST = 0.4
# Images at which it may begin, or stop, to move that are tried first.
_FIRST_SWITCHES = 6
# A start far from the boxes is brought near with boxes whose sigmas are so many times larger.
_LESS_SURE = (20.0, 4.0)
_COARSE_ITERATIONS = 15
# Of a thing at rest, so many boxes tell which start is near.
_FEW = 10


@dataclass(frozen=True, eq=False)
class Judgment:
    """What a thing does, how sure that is, and its estimate."""

    behavior: Behavior
    probability: dict[Behavior, float]
    """Of each hypothesis; 0 for one whose estimate failed."""
    fit: TrackFit
    """Of the most likely one."""
    moves: Bools
    """Whether it moves between images, shape (n - 1,)."""
    above: Floats
    """What heights above the ground are in units of, meters, shape (n,)."""

    @property
    def is_mover(self) -> bool:
        """Whether it surely moves: by at least half its length, or errors of boxes may be it."""
        if self.probability["rests"] > MOST_PROBABLY_RESTS or self.behavior == "rests":
            return False
        place = self.fit.trajectory.state[:, X : Y + 1]
        reach = np.linalg.norm(place - place[0], axis=1).max()
        return bool(reach > np.exp(self.fit.trajectory.log_half[0]))


def judge(problem: TrackProblem, path: Floats | None = None) -> Judgment | None:
    """Compare what a thing may do; None where no hypothesis has an estimate.

    ``path`` (6 n, 6 n) is the joint covariance of small motions [m, rad] of the cameras, each in
    its own frame, by default none: a path that errs makes what rests move.
    """
    count = len(problem.seconds)
    places, weight = rough_places(problem)
    all_along, never = np.ones(count - 1, dtype=np.bool_), np.zeros(count - 1, dtype=np.bool_)
    fits: dict[Behavior, tuple[TrackFit, Bools, float]] = {}
    moving = _fit(problem, moving_start(problem, places, weight), all_along)
    if moving is not None:
        other = fit_track(problem, mirrored_start(problem, moving.trajectory), all_along)
        if other is not None and other.log_evidence > moving.log_evidence:
            moving = other
    resting = _rest(problem, resting_starts(problem, places, weight))
    if resting is not None:
        fits["rests"] = resting, never, 0.0
    if moving is not None:
        fits["moves"] = moving, all_along, 0.0
        both = _stops(problem, moving)
        if both is not None:
            fits["stops and goes"] = both
    if not fits:
        return None
    log_odds = {
        name: float(np.log(PRIOR[name]))
        + fit.log_evidence
        - cost
        + (0.0 if path is None else evidence_of_path(fit, path))
        for name, (fit, _, cost) in fits.items()
    }
    most = max(log_odds.values())
    total = sum(np.exp(one - most) for one in log_odds.values())
    probability: dict[Behavior, float] = dict.fromkeys(PRIOR, 0.0)
    probability |= {name: float(np.exp(one - most) / total) for name, one in log_odds.items()}
    behavior = max(log_odds, key=lambda name: log_odds[name])
    fit, moves, _ = fits[behavior]
    return Judgment(behavior, probability, fit, moves, problem.above)


def _stops(problem: TrackProblem, moving: TrackFit) -> tuple[TrackFit, Bools, float] | None:
    """Return the likeliest estimate with rests, near where the one that moves all along is slow.

    It rests where that is slower than some speed; or until, or from, an image on. Each begin and
    end of a rest may be at any of the images: its evidence is shared among them.
    """
    speed = np.abs(moving.trajectory.state[:, SPEED])
    count = len(speed)
    if speed.min() > max(MAY_REST * speed.max(), SLOW[-1]):
        return None
    best: tuple[TrackFit, Bools, float] | None = None
    tried: set[bytes] = set()

    def attempt(moves: Bools) -> None:
        nonlocal best
        if moves.all() or not moves.any() or moves.tobytes() in tried:
            return
        tried.add(moves.tobytes())
        rests = np.append(~moves, False) | np.append(False, ~moves)
        fit = _fit(problem, stopping_start(moving.trajectory, rests), moves)
        cost = float(np.sum(moves[1:] != moves[:-1]) * np.log(count))
        if fit is not None and (
            best is None or fit.log_evidence - cost > best[0].log_evidence - best[2]
        ):
            best = fit, moves, cost

    for slow in SLOW:
        attempt(~((speed < slow)[:-1] & (speed < slow)[1:]))
    leaves = bool(speed[: count // 2].sum() < speed[-(count // 2) :].sum())
    images = np.arange(count - 1)
    step = max((count - 1) // _FIRST_SWITCHES, 1)
    for switch in range(step, count - 1, step):
        attempt((images >= switch) if leaves else (images < switch))
    while best is not None and step > 1:
        step //= 2
        now = best[1]
        if np.sum(now[1:] != now[:-1]) == 1:
            switch = int(np.flatnonzero(now[1:] != now[:-1])[0]) + 1
            for other in (switch - step, switch + step):
                attempt((images >= other) if now[-1] else (images < other))
    return best


def _fit(problem: TrackProblem, start: Trajectory, moves: Bools) -> TrackFit | None:
    """Fit from a start that may be far off: first with boxes that are less sure."""
    at = start
    for less_sure in _LESS_SURE:
        coarse = replace(problem, variance=problem.variance * less_sure**2)
        near = fit_track(coarse, at, moves, max_iterations=_COARSE_ITERATIONS)
        if near is None:
            return None
        at = near.trajectory
    return fit_track(problem, at, moves)


def _rest(problem: TrackProblem, starts: list[Trajectory]) -> TrackFit | None:
    """Return the estimate at rest from the likeliest start, by some of the boxes."""
    count = len(problem.seconds)
    some = np.zeros(count, dtype=np.bool_)
    some[np.linspace(0, count - 1, min(count, _FEW)).round().astype(int)] = True
    few = problem.select(some)
    few = replace(few, variance=few.variance * _LESS_SURE[-1] ** 2)
    still = np.zeros(some.sum() - 1, dtype=np.bool_)
    fits = [
        fit_track(
            few,
            Trajectory(start.state[some], start.log_half),
            still,
            max_iterations=_COARSE_ITERATIONS,
        )
        for start in starts
    ]
    found = [fit for fit in fits if fit is not None]
    if not found:
        return None
    best = max(found, key=lambda fit: fit.log_evidence).trajectory
    state = np.tile(best.state[:1], (count, 1))
    never = np.zeros(count - 1, dtype=np.bool_)
    return fit_track(problem, Trajectory(state, best.log_half), never)
