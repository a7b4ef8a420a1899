"""The search for the poses that explain the boxes of images, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.places.location.hypotheses import Hypotheses, find_hypotheses
from dqslam.places.location.pairs import pair_up
from dqslam.places.location.place_map import MOST_OBJECTS, PlaceMap
from dqslam.places.location.quick_score import quick_score
from dqslam.places.location.score import SE3, Frame, Matches, Scored, Scorer

# Hypotheses of each image that are compared with its boxes quickly, in a small and in a large map,
# and scored.
_MOST_QUICK, _MOST_QUICK_LARGE, _MOST_SCORED = 4000, 500, 24
# Hypotheses that each round of assignment and refinement continues with, likewise.
_MOST_REFINED, _MOST_REFINED_LARGE = (24, 8, 8), (12, 4, 4)
# Poses as near as this lead to the same: a share of the sight, and radians.
_SAME_SHARE, _SAME_ANGLE = 0.03, 0.1
# Side of the cells in which similar hypotheses are counted, and the number of grids; what makes
# one number of the nine of a cell.
_CELL, _GRIDS = 2.0, 6
_HASH = np.array(
    [73856093, 19349663, 83492791, 49979687, 86028121, 67867967, 32452843, 15485863, 1]
)
# Poses as near as this are one answer.
_ONE_SHARE, _ONE_ANGLE = 0.12, 0.25


@dataclass(frozen=True, eq=False)
class Places:
    """Different poses that explain the boxes, best first."""

    poses: Floats
    """world_from_camera of the reference image, shape (p, 7)."""
    log_odds: Floats
    """Logarithm of the probability of each, against an image that shows none of the objects here.

    Shape (p,).
    """
    covariance: Floats
    """In the tangents of the poses, shape (p, 6, 6)."""
    matches: Matches
    missing: Ints
    """Objects that each expects in vain, shape (p,)."""
    log_elsewhere: float
    """Likewise of another place."""
    is_given_up: bool = False
    """Whether there are too many objects alike in the map to look for places."""


def find_places(place: PlaceMap, camera: _core.Camera, frames: list[Frame]) -> Places:
    """Find the places, none if no three boxes agree."""
    starts = [_starts(place, camera, frame) for frame in frames]
    poses = np.concatenate([np.zeros((0, 7)), *[one for one, _ in starts]])
    elsewhere = sum(frame.boxes.log_elsewhere for frame in frames)
    if not len(poses):
        none = np.zeros(0, dtype=np.int64)
        matches = Matches(none, none, none, none)
        given_up = any(one for _, one in starts)
        return Places(poses, np.zeros(0), np.zeros((0, 6, 6)), matches, none, elsewhere, given_up)
    scorer = Scorer(place, camera, frames)
    scored = scorer.score(poses)
    is_large = len(place.ellipsoids) > MOST_OBJECTS
    for most in _MOST_REFINED_LARGE if is_large else _MOST_REFINED:
        scored = scored.select(distinct(scored.poses, scored.score, place.sensor.sight, most))
        poses, _ = scorer.refine(scored)
        scored = scorer.score(poses)
    return _weigh(place, scorer, scored, elsewhere)


def _weigh(place: PlaceMap, scorer: Scorer, scored: Scored, elsewhere: float) -> Places:
    """Give different poses the integral of the probability around each (Laplace)."""
    from scipy.spatial.transform import Rotation

    _, information, _ = scorer.linearize(scored.poses, scored.matches)
    _, log_determinant = np.linalg.slogdet(information)
    prior = np.full(len(scored.poses), -np.log(place.volume * 8.0 * np.pi**2))
    if place.upright is not None:
        rotation = Rotation.from_quat(scored.poses[:, 3:]).as_matrix()
        prior += place.upright.log_prior(rotation)
    log_odds = scored.score + prior + 3.0 * np.log(2.0 * np.pi) - 0.5 * log_determinant
    sight = place.sensor.sight
    best = distinct(scored.poses, log_odds, sight, len(log_odds), _ONE_SHARE, _ONE_ANGLE)
    joined, covariance = _join(
        scored.poses,
        log_odds,
        np.asarray(place.sensor.tail * np.linalg.inv(information), dtype=np.float64),
        best,
        sight,
    )
    order = np.argsort(-joined, kind="stable")
    chosen = scored.select(best[order])
    return Places(
        chosen.poses, joined[order], covariance[order], chosen.matches, chosen.missing, elsewhere
    )


def _join(
    poses: Floats, log_odds: Floats, covariance: Floats, best: Ints, sight: float
) -> tuple[Floats, Floats]:
    """Add the poses that are near each of the best to it: log-odds (p,), covariances (p, 6, 6).

    Another assignment of a box moves a pose a little, and is no other answer.
    """
    left = np.isfinite(log_odds)
    joined, spread = np.zeros(len(best)), np.zeros((len(best), 6, 6))
    for place, row in enumerate(best.tolist()):
        own = left & _near(poses, poses[[row]], sight, _ONE_SHARE, _ONE_ANGLE)[:, 0]
        left &= ~own
        joined[place] = np.logaddexp.reduce(log_odds[own])
        share = np.exp(log_odds[own] - joined[place])
        apart = _core.minus(SE3, poses[own], np.tile(poses[row], (int(own.sum()), 1)))
        outer = apart[:, :, None] * apart[:, None, :]
        spread[place] = np.einsum("k,kij->ij", share, covariance[own] + outer)
    return joined, spread


def _near(a: Floats, b: Floats, sight: float, share: float, angle: float) -> Bools:
    """Tell which poses (n, 7) and (m, 7) are nearer than a share of the sight and an angle."""
    apart = np.linalg.norm(a[:, None, :3] - b[None, :, :3], axis=2)
    same_half = np.abs(a[:, 3:] @ b[:, 3:].T)  # the cosine of half the angle
    return np.asarray((apart < share * sight) & (same_half > np.cos(0.5 * angle)))


def distinct(
    poses: Floats,
    score: Floats,
    sight: float,
    most: int,
    share: float = _SAME_SHARE,
    angle: float = _SAME_ANGLE,
) -> Ints:
    """Return the rows of the best poses, best first, no two of which are near each other."""
    order = np.argsort(-score, kind="stable")
    order = order[np.isfinite(score[order])]
    same = _near(poses[order], poses[order], sight, share, angle)
    left = np.ones(len(order), dtype=np.bool_)
    chosen: list[int] = []
    for row in range(len(order)):
        if left[row] and len(chosen) < most:
            chosen.append(row)
            left &= ~same[row]
    return order[np.array(chosen, dtype=np.int64)]


def _starts(place: PlaceMap, camera: _core.Camera, frame: Frame) -> tuple[Floats, bool]:
    """Return the best hypotheses of an image as poses of the reference image, shape (h, 7).

    Also return whether the search was given up.
    """
    from scipy.spatial.transform import Rotation

    image = frame.boxes
    pairings = pair_up(place, camera, image)
    whole = np.asarray(~image.truncated.any(axis=1))
    is_large = len(place.ellipsoids) > MOST_OBJECTS
    most = _MOST_QUICK_LARGE if is_large else _MOST_QUICK
    found = find_hypotheses(pairings, whole, place.upright, is_large=is_large)
    given_up = found.is_given_up
    found = _strongest(found, place.sensor.sight, most)
    score = quick_score(place, image, pairings, found)
    if place.upright is not None:
        score += place.upright.log_prior(found.rotation)
    best = np.argsort(-score, kind="stable")[: 4 * _MOST_SCORED]
    quaternion = Rotation.from_matrix(found.rotation[best]).as_quat() if len(best) else []
    poses = np.column_stack([found.position[best], np.reshape(quaternion, (-1, 4))])
    poses = poses[distinct(poses, score[best], place.sensor.sight, _MOST_SCORED)]
    back = _core.inverse(SE3, frame.reference_from_image[None])
    return _core.compose(SE3, poses, np.tile(back, (len(poses), 1))), given_up


def _strongest(found: Hypotheses, sight: float, most: int) -> Hypotheses:
    """Return the hypotheses that most others are near to, if there are more than ``most``."""
    count = len(found.position)
    if count <= most:
        return found
    where = np.hstack(
        [found.position / (0.1 * sight), found.rotation[:, :, 0] * 5, found.rotation[:, :, 2] * 5]
    )
    # How many share a cell, in grids that are shifted against each other.
    near = np.zeros(count)
    shifts = np.random.default_rng(0).uniform(0.0, _CELL, (_GRIDS, where.shape[1]))
    for shift in shifts:
        cells = np.floor((where + shift) / _CELL).astype(np.int64)
        _, cell, counts = np.unique(cells @ _HASH, return_inverse=True, return_counts=True)
        near += counts[cell.reshape(-1)]
    keep = np.argsort(-near, kind="stable")[:most]
    return Hypotheses(found.rotation[keep], found.position[keep])
