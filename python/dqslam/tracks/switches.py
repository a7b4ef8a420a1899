"""When a thing that rests in part begins and stops to move, and all that its boxes leave open."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.tracks.fit import LESS_SURE, TrackFit, fit_from_afar, fit_track
from dqslam.tracks.motion import SPEED
from dqslam.tracks.problem import TrackProblem
from dqslam.tracks.start import stopping_start

# What is slower than one of these speeds [m/s] may be at rest.
SLOW = (0.3, 0.6, 1.0, 2.0)
# It rests in part only if it is so slow there, as a share of its highest speed.
MAY_REST = 0.4
# Images at which it may begin, or stop, to move that are tried first.
_FIRST_SWITCHES = 6
# Explanations whose evidence is less than the best by so much count for nothing, ...
_NEGLIGIBLE = 5.0
# ... and so many are tried beside those of the search: of a long track, not each image is.
_MOST_TRIED, _MOST_PLACES = 40, 60


@dataclass(frozen=True, eq=False)
class Explanation:
    """An estimate under one hypothesis of when the thing moves."""

    fit: TrackFit
    moves: Bools
    """Whether it moves between images, shape (n - 1,)."""
    log_evidence: float
    """That of the fit, and what is believed of such begins and ends of rests beforehand."""

    @property
    def is_moving(self) -> Bools:
        """Whether it moves before or after each image, shape (n,)."""
        return np.asarray(np.append(self.moves, False) | np.append(False, self.moves))


def explain_with_rests(problem: TrackProblem, moving: TrackFit) -> list[Explanation]:
    """Return estimates with rests near where the one that moves all along is slow.

    The likeliest is first. Each begin and end of a rest may be at any of the images, and all that
    are likely are returned. There are none where it is nowhere slow.
    """
    speed = np.abs(moving.trajectory.state[:, SPEED])
    if speed.min() > max(MAY_REST * speed.max(), SLOW[-1]):
        return []
    best = _search(problem, moving, speed)
    if best is None:
        return []
    ways = _spread_out(problem, best)
    most = max(way.log_evidence for way in ways)
    kept = [way for way in ways if way.log_evidence > most - _NEGLIGIBLE]
    return sorted(kept, key=lambda way: -way.log_evidence)


def _search(problem: TrackProblem, moving: TrackFit, speed: Floats) -> Explanation | None:
    """Return the likeliest of some estimates with rests.

    It rests where it is slower than some speed; or until, or from, an image on.
    """
    count = len(speed)
    best: Explanation | None = None
    tried: set[bytes] = set()

    def attempt(moves: Bools) -> None:
        nonlocal best
        if moves.all() or not moves.any() or moves.tobytes() in tried:
            return
        tried.add(moves.tobytes())
        start = stopping_start(moving.trajectory, _rests(moves))
        fit = fit_from_afar(problem, start, moves, less_sure=LESS_SURE[-1:])
        way = None if fit is None else _explanation(fit, moves)
        if way is not None and (best is None or way.log_evidence > best.log_evidence):
            best = way

    for slow in SLOW:
        attempt(~((speed < slow)[:-1] & (speed < slow)[1:]))
    leaves = bool(speed[: count // 2].sum() < speed[-(count // 2) :].sum())
    images = np.arange(count - 1)
    step = max((count - 1) // _FIRST_SWITCHES, 1)
    for switch in range(step, count - 1, step):
        attempt((images >= switch) if leaves else (images < switch))
    while best is not None and step > 1:
        step //= 2
        now = best.moves
        if np.sum(now[1:] != now[:-1]) == 1:
            switch = int(np.flatnonzero(now[1:] != now[:-1])[0]) + 1
            for other in (switch - step, switch + step):
                attempt((images >= other) if now[-1] else (images < other))
    return best


def _spread_out(problem: TrackProblem, best: Explanation) -> list[Explanation]:
    """Return a likely estimate, and those whose switches are a little earlier or later.

    From the likeliest on, each switch of each is moved, until the evidence gets negligible.
    """
    found, seen = [best], {best.moves.tobytes()}
    waiting = [(-best.log_evidence, 0)]
    most, tries = best.log_evidence, 0
    while waiting and tries < _MOST_TRIED:
        below, number = heapq.heappop(waiting)
        if -below < most - _NEGLIGIBLE:
            break
        for moves in _shifted(found[number].moves):
            if moves.tobytes() in seen:
                continue
            seen.add(moves.tobytes())
            tries += 1
            start = stopping_start(found[number].fit.trajectory, _rests(moves))
            fit = fit_track(problem, start, moves)
            if fit is None:
                continue
            found.append(_explanation(fit, moves))
            most = max(most, found[-1].log_evidence)
            heapq.heappush(waiting, (-found[-1].log_evidence, len(found) - 1))
    return found


def _shifted(moves: Bools) -> list[Bools]:
    """Return the same moves (n - 1,) with one begin or end of a rest earlier or later."""
    step, shifted = _stride(len(moves) + 1), []
    for switch in (np.flatnonzero(moves[1:] != moves[:-1]) + 1).tolist():
        for other in (max(switch - step, 0), min(switch + step, len(moves))):
            changed = moves.copy()
            if other < switch:
                changed[other:switch] = moves[switch]
            else:
                changed[switch:other] = moves[switch - 1]
            if changed.any() and not changed.all():
                shifted.append(changed)
    return shifted


def _explanation(fit: TrackFit, moves: Bools) -> Explanation:
    """Weigh an estimate: each of its switches could be at any of the images."""
    places = (len(moves) + 1) / _stride(len(moves) + 1)
    switches = int(np.sum(moves[1:] != moves[:-1]))
    return Explanation(fit, moves, fit.log_evidence - switches * float(np.log(places)))


def _stride(count: int) -> int:
    """Return by how many images switches of a track in ``count`` images are moved."""
    return max(count // _MOST_PLACES, 1)


def _rests(moves: Bools) -> Bools:
    """Return in which images a thing rests before or after, (n,)."""
    return np.asarray(np.append(~moves, False) | np.append(False, ~moves))
