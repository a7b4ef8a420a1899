"""A quick score of hypotheses: by directions and distances of the objects that boxes may show."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.places.location.hypotheses import Hypotheses
from dqslam.places.location.pairs import Pairings
from dqslam.places.location.place_map import AHEAD, MOST_OBJECTS, ImageBoxes, PlaceMap

# Sigma of the direction of a box's middle: constant [rad], and a share of its half side.
_RAY_SIGMA, _RAY_SHARE = 0.015, 0.25
# Cells of a table that is made at once.
_MOST_CELLS = 300_000


def quick_score(
    place: PlaceMap, image: ImageBoxes, pairings: Pairings, found: Hypotheses
) -> Floats:
    """Score hypotheses, (h,)."""
    if not len(found.position):
        return np.zeros(0)
    variance = np.diagonal(image.covariance, axis1=1, axis2=2)
    free = ~image.truncated
    peak = -0.5 * np.where(free, np.log(2.0 * np.pi * variance), 0.0).sum(axis=1)
    gain = pairings.log_odds + (peak - image.log_false)[pairings.box]
    useful: Bools = gain > 0.0
    if not useful.any():
        return np.zeros(len(found.position))
    pairings, gain = pairings.select(useful), gain[useful]
    if len(place.ellipsoids) > MOST_OBJECTS:
        return _score_near(place, pairings, gain, found)
    return _score_all(place, pairings, gain, found)


def _score_all(place: PlaceMap, pairings: Pairings, gain: Floats, found: Hypotheses) -> Floats:
    """Compare each hypothesis with all pairings."""
    box = pairings.box
    half = np.exp(place.size[pairings.object_row, 0] - pairings.log_distance)
    precision_ray = 1.0 / np.hypot(_RAY_SIGMA, _RAY_SHARE * half)[:, None] ** 2
    precision = 1.0 / pairings.sigma[:, None]
    first = np.flatnonzero(np.concatenate([[True], box[1:] != box[:-1]]))
    rows, row = np.unique(pairings.object_row, return_inverse=True)
    # Near the middle of the map, squares of coordinates lose no digits of distances.
    middle = place.ellipsoids[rows, :3].mean(axis=0)
    center = place.ellipsoids[rows, :3] - middle
    # ray . R^T (center - position), as products of matrices of pairings with those of hypotheses
    outer = ((pairings.center - middle)[:, :, None] * pairings.ray[:, None, :]).reshape(-1, 9)
    score = np.zeros(len(found.position))
    chunk = max(1, _MOST_CELLS // len(box))
    for start in range(0, len(score), chunk):
        part = slice(start, start + chunk)
        rotation, position = found.rotation[part], found.position[part] - middle
        ahead = outer @ rotation.reshape(-1, 9).T
        ahead -= pairings.ray @ (position[:, None, :] @ rotation)[:, 0].T
        square = -2.0 * (center @ position.T)
        square += (center**2).sum(axis=1)[:, None] + (position**2).sum(axis=1)
        log_distance = 0.5 * np.log(np.maximum(square, 1e-12))
        ahead *= np.exp(-log_distance)[row]
        error = (log_distance[row] - pairings.log_distance[:, None]) * precision
        own = gain[:, None] - precision_ray * (1.0 - ahead) - 0.5 * error**2
        score[part] = np.maximum(np.maximum.reduceat(own, first, axis=0), 0.0).sum(axis=0)
    return score


def _score_near(place: PlaceMap, pairings: Pairings, gain: Floats, found: Hypotheses) -> Floats:
    """Compare each hypothesis with the pairings of the objects before it."""
    order = np.argsort(pairings.object_row, kind="stable")
    bounds = np.searchsorted(pairings.object_row[order], np.arange(len(place.ellipsoids) + 1))
    counts = np.diff(bounds)
    half = np.exp(place.size[pairings.object_row, 0] - pairings.log_distance)
    sigma_ray = np.hypot(_RAY_SIGMA, _RAY_SHARE * half)
    boxes = int(pairings.box.max()) + 1
    ahead = found.position + AHEAD * place.sensor.sight * found.rotation[:, :, 2]
    _, rows = place.tree.query(ahead, k=place.in_reach)
    score = np.zeros(len(ahead))
    chunk = max(1, _MOST_CELLS // (place.in_reach * boxes))
    for start in range(0, len(score), chunk):
        part = slice(start, start + chunk)
        position, rotation, near = found.position[part], found.rotation[part], rows[part]
        inside = (place.ellipsoids[near, :3] - position[:, None]) @ rotation
        distance = np.sqrt((inside**2).sum(axis=2)).ravel()
        each = counts[near.ravel()]  # pairings of each hypothesis and object
        cell = np.repeat(np.arange(len(distance)), each)
        step = np.arange(len(cell)) - np.repeat(np.cumsum(each) - each, each)
        one = order[bounds[near.ravel()[cell]] + step]
        cosine = (inside.reshape(-1, 3)[cell] * pairings.ray[one]).sum(axis=1) / distance[cell]
        error = 2.0 * (1.0 - cosine) / sigma_ray[one] ** 2
        error += ((np.log(distance)[cell] - pairings.log_distance[one]) / pairings.sigma[one]) ** 2
        best = np.zeros((len(position), boxes))
        hypothesis = cell // near.shape[1]
        np.maximum.at(best, (hypothesis, pairings.box[one]), gain[one] - 0.5 * error)
        score[part] = best.sum(axis=1)
    return score
