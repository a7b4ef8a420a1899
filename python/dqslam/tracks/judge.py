"""Whether a thing rests, moves, or rests and moves in turn: by the evidence of each hypothesis.

All three are one model of motion; what rests has no speed, no turn rate and next to no noise. Their
marginal likelihoods, by Laplace's method, are compared: a motion that the boxes do not need costs
what it could have been otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Floats
from dqslam.track import Behavior
from dqslam.tracks.fit import (
    COARSE_ITERATIONS,
    LESS_SURE,
    TrackFit,
    evidence_with_path,
    fit_from_afar,
    fit_track,
)
from dqslam.tracks.motion import X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory
from dqslam.tracks.start import (
    mirrored_start,
    moving_start,
    resting_starts,
    rough_places,
)
from dqslam.tracks.switches import Explanation, explain_with_rests

# What of things that are seen is at rest, moves, and does both, before their boxes say more.
PRIOR: dict[Behavior, float] = {"rests": 0.6, "moves": 0.3, "stops and goes": 0.1}
# A thing moves if it rests with at most this probability.
MOST_PROBABLY_RESTS = 0.01
# Whether it rests in part is not asked if rest is likelier than motion by so much, a logarithm.
SURELY_RESTS = 4.0
# Of a thing at rest, so many boxes tell which start is near.
_FEW = 10


@dataclass(frozen=True, eq=False)
class Judgment:
    """What a thing does, how sure that is, and its estimate."""

    behavior: Behavior
    probability: dict[Behavior, float]
    """Of each hypothesis; 0 for one whose estimate failed."""
    explanations: tuple[Explanation, ...]
    """Of the motion, or of the rest where that is likeliest; the likeliest one first."""
    weights: Floats
    """Of the explanations, their sum is 1."""
    above: Floats
    """What heights above the ground are in units of, meters, shape (n,)."""

    @property
    def is_mover(self) -> bool:
        """Whether it surely moves: by at least half its length, or errors of boxes may be it."""
        if self.probability["rests"] > MOST_PROBABLY_RESTS or self.behavior == "rests":
            return False
        likeliest = self.explanations[0].fit.trajectory
        place = likeliest.state[:, X : Y + 1]
        reach = np.linalg.norm(place - place[0], axis=1).max()
        return bool(reach > np.exp(likeliest.log_half[0]))


def judge(problem: TrackProblem, path: Floats | None = None) -> Judgment | None:
    """Compare what a thing may do; None where no hypothesis has an estimate.

    ``path`` (6 n, 6 n) is the joint covariance of small motions [m, rad] of the cameras, each in
    its own frame, by default none: a path that errs makes what rests move.
    """
    count = len(problem.seconds)
    places, weight = rough_places(problem)
    all_along, never = np.ones(count - 1, dtype=np.bool_), np.zeros(count - 1, dtype=np.bool_)
    found: dict[Behavior, list[Explanation]] = {}
    log_odds: dict[Behavior, Floats] = {}

    def weigh(name: Behavior, ways: list[Explanation]) -> None:
        # Explanations of one behavior are alike: what the path explains of one, it does of all.
        first = ways[0].fit
        gain = 0.0
        if path is not None:
            gain = evidence_with_path(problem, first, ways[0].moves, path) - first.log_evidence
        found[name] = ways
        prior = float(np.log(PRIOR[name]))
        log_odds[name] = np.array([prior + gain + way.log_evidence for way in ways])

    resting = _rest(problem, resting_starts(problem, places, weight))
    if resting is not None:
        weigh("rests", [Explanation(resting, never, resting.log_evidence)])
    moving = fit_from_afar(problem, moving_start(problem, places, weight), all_along)
    if moving is not None:
        other = fit_track(problem, mirrored_start(problem, moving.trajectory), all_along)
        if other is not None and other.log_evidence > moving.log_evidence:
            moving = other
        weigh("moves", [Explanation(moving, all_along, moving.log_evidence)])
        # What moves in some of the images is likelier to move all along than to rest.
        surely = resting is not None and log_odds["rests"][0] > log_odds["moves"][0] + SURELY_RESTS
        with_rests = [] if surely else explain_with_rests(problem, moving)
        if with_rests:
            weigh("stops and goes", with_rests)
    if not found:
        return None
    most = max(float(odds.max()) for odds in log_odds.values())
    share = {name: np.exp(odds - most) for name, odds in log_odds.items()}
    total = float(sum(part.sum() for part in share.values()))
    probability: dict[Behavior, float] = dict.fromkeys(PRIOR, 0.0)
    probability |= {name: float(part.sum()) / total for name, part in share.items()}
    behavior = max(share, key=lambda name: probability[name])
    shown = [name for name in share if (name == "rests") == (behavior == "rests")]
    ways = [way for name in shown for way in found[name]]
    weights = np.concatenate([share[name] for name in shown])
    order = np.argsort(-weights, kind="stable")
    return Judgment(
        behavior,
        probability,
        tuple(ways[row] for row in order.tolist()),
        weights[order] / weights.sum(),
        problem.above,
    )


def _rest(problem: TrackProblem, starts: list[Trajectory]) -> TrackFit | None:
    """Return the estimate at rest from the likeliest start, by some of the boxes."""
    count = len(problem.seconds)
    some = np.zeros(count, dtype=np.bool_)
    some[np.linspace(0, count - 1, min(count, _FEW)).round().astype(int)] = True
    few = problem.select(some)
    few = replace(few, variance=few.variance * LESS_SURE[-1] ** 2)
    still = np.zeros(some.sum() - 1, dtype=np.bool_)
    fits = [
        fit_track(
            few,
            Trajectory(start.state[some], start.log_half),
            still,
            max_iterations=COARSE_ITERATIONS,
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
