"""The search for the poses that explain the boxes of images, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.places.locate_hypotheses import Hypotheses, Pairings, find_hypotheses, pair_up
from dqslam.places.locate_map import ImageBoxes, PlaceMap
from dqslam.places.locate_score import SE3, Frame, Matches, Scorer

# Hypotheses of each image that are compared with its boxes quickly, scored, and refined.
_MOST_QUICK, _MOST_SCORED, _MOST_REFINED = 4000, 40, 12
# Sigma of the direction of a box's middle: constant [rad], and a share of its half side.
_RAY_SIGMA, _RAY_SHARE = 0.015, 0.25
# Poses as near as this are one: a share of the sight, and radians.
_SAME_SHARE, _SAME_ANGLE = 0.03, 0.1
# Rounds of assignment and refinement.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Places:
    """Different poses that explain the boxes, best first."""

    poses: Floats
    """world_from_camera of the reference image, shape (p, 7)."""
    log_odds: Floats
    """Logarithm of the probability of each, against an image of another place; shape (p,)."""
    information: Floats
    """In the tangents of the poses, shape (p, 6, 6)."""
    matches: Matches
    missing: Ints
    """Objects that each expects in vain, shape (p,)."""


def find_places(place: PlaceMap, camera: _core.Camera, frames: list[Frame]) -> Places:
    """Find the places, none if no three boxes agree."""
    starts = [_starts(place, camera, frame) for frame in frames]
    poses = np.concatenate([np.zeros((0, 7)), *starts])
    scorer = Scorer(place, camera, frames)
    if not len(poses):
        return Places(
            poses, np.zeros(0), np.zeros((0, 6, 6)), scorer.score(poses).matches, np.zeros(0, int)
        )
    scored = scorer.score(poses)
    for turn in range(_ROUNDS):
        most = _MOST_SCORED if turn == 0 else _MOST_REFINED
        best = distinct(scored.poses, scored.score, place.sensor.sight, most)
        scored = scorer.score(scored.poses[best])
        poses, _ = scorer.refine(scored)
        scored = scorer.score(poses)
    return _weigh(place, scorer, scored.poses)


def _weigh(place: PlaceMap, scorer: Scorer, poses: Floats) -> Places:
    """Give different poses the integral of the probability around each (Laplace)."""
    scored = scorer.score(poses)
    _, information, _ = scorer.linearize(scored.poses, scored.matches)
    _, log_determinant = np.linalg.slogdet(information)
    prior = -np.log(place.volume * 8.0 * np.pi**2)
    if place.upright is not None:
        prior += place.upright.log_prior(Rotation.from_quat(poses[:, 3:]).as_matrix())
    log_odds = scored.score + prior + 3.0 * np.log(2.0 * np.pi) - 0.5 * log_determinant
    best = distinct(scored.poses, log_odds, place.sensor.sight, len(poses))
    order = np.full(len(poses), -1)
    order[best] = np.arange(len(best))
    matches = scored.matches.select(order[scored.matches.hypothesis] >= 0)
    return Places(
        poses=scored.poses[best],
        log_odds=log_odds[best],
        information=information[best],
        matches=Matches(order[matches.hypothesis], matches.frame, matches.box, matches.object_row),
        missing=scored.missing[best],
    )


def distinct(poses: Floats, score: Floats, sight: float, most: int) -> Ints:
    """Return the rows of the best poses, best first, no two of which are the same."""
    order = np.argsort(-score, kind="stable")
    rotation = Rotation.from_quat(poses[:, 3:]).as_matrix()
    chosen: list[int] = []
    for row in order.tolist():
        if len(chosen) == most or not np.isfinite(score[row]):
            break
        if chosen:
            near = np.linalg.norm(poses[chosen, :3] - poses[row, :3], axis=1) < _SAME_SHARE * sight
            trace = np.einsum("nij,ij->n", rotation[chosen], rotation[row])
            if (near & (trace > 1.0 + 2.0 * np.cos(_SAME_ANGLE))).any():
                continue
        chosen.append(row)
    return np.array(chosen, dtype=np.int64)


def _starts(place: PlaceMap, camera: _core.Camera, frame: Frame) -> Floats:
    """Return the best hypotheses of an image as poses of the reference image, shape (h, 7)."""
    image = frame.boxes
    pairings = pair_up(place, camera, image)
    whole = ~image.truncated.any(axis=1)
    found = _strongest(find_hypotheses(pairings, whole, place.upright), place.sensor.sight)
    score = _quick_score(place, image, pairings, found)
    if place.upright is not None:
        score += place.upright.log_prior(found.rotation)
    best = np.argsort(-score, kind="stable")[: 4 * _MOST_SCORED]
    quaternion = Rotation.from_matrix(found.rotation[best]).as_quat() if len(best) else []
    poses = np.column_stack([found.position[best], np.reshape(quaternion, (-1, 4))])
    poses = poses[distinct(poses, score[best], place.sensor.sight, _MOST_SCORED)]
    back = _core.inverse(SE3, frame.reference_from_image[None])
    return _core.compose(SE3, poses, np.tile(back, (len(poses), 1)))


def _strongest(found: Hypotheses, sight: float) -> Hypotheses:
    """Return the hypotheses that most others are near to, if there are very many."""
    count = len(found.position)
    if count <= _MOST_QUICK:
        return found
    where = np.hstack(
        [found.position / (0.1 * sight), found.rotation[:, :, 0] * 5, found.rotation[:, :, 2] * 5]
    )
    near = cKDTree(where).query_ball_point(where, 1.0, return_length=True)
    keep = np.argsort(-near, kind="stable")[:_MOST_QUICK]
    return Hypotheses(found.rotation[keep], found.position[keep])


def _quick_score(
    place: PlaceMap, image: ImageBoxes, pairings: Pairings, found: Hypotheses
) -> Floats:
    """Score hypotheses by directions and distances of the objects that boxes may show, (h,)."""
    if not len(found.position):
        return np.zeros(0)
    variance = np.diagonal(image.covariance, axis1=1, axis2=2)
    free = ~image.truncated
    peak = -0.5 * np.where(free, np.log(2.0 * np.pi * variance), 0.0).sum(axis=1)
    gain = pairings.log_odds + (peak - image.log_false)[pairings.box]
    useful: Bools = gain > 0.0
    box, ray, center = pairings.box[useful], pairings.ray[useful], pairings.center[useful]
    if not len(box):
        return np.zeros(len(found.position))
    half = np.exp(place.size[pairings.object_row[useful], 0] - pairings.log_distance[useful])
    sigma_ray = np.hypot(_RAY_SIGMA, _RAY_SHARE * half)
    first = np.flatnonzero(np.concatenate([[True], box[1:] != box[:-1]]))
    score = np.zeros(len(found.position))
    chunk = max(1, 2_000_000 // len(box))
    for start in range(0, len(score), chunk):
        part = slice(start, start + chunk)
        rotation, position = found.rotation[part], found.position[part]
        offset = np.einsum("hi,hij->hj", position, rotation)
        inside = np.einsum("ni,hij->hnj", center, rotation) - offset[:, None, :]
        distance = np.sqrt((inside**2).sum(axis=2))
        cosine = (inside * ray).sum(axis=2) / distance
        error = 2.0 * (1.0 - cosine) / sigma_ray**2
        error += ((np.log(distance) - pairings.log_distance[useful]) / pairings.sigma[useful]) ** 2
        own = np.maximum(gain[useful] - 0.5 * error, 0.0)
        score[part] = np.maximum.reduceat(own, first, axis=1).sum(axis=1)
    return score
