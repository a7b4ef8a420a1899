"""Search all motions between two maps: from triangles to the whole maps.

Triangles that agree give motions. Each is judged by the objects around it, fitted to those that
agree, and the better ones are judged by a wider surrounding, until it is the whole map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.places.alignment.likelihood import Objects, Target, log_densities
from dqslam.places.alignment.rigid import MotionModel, Motions
from dqslam.places.alignment.triangles import find_triangles, match_triangles

_TRIANGLES = 150_000  # of a map
_MATCHES = 3_000_000  # of triangles
_FIRST = 20_000  # motions that are judged
_FIRST_NEIGHBORS = 12
_WORK = 100_000  # places that are looked up at a time
_FEWEST = 24  # motions that are judged by the whole maps
_MOST = 120
# Sides agree within three sigmas of the error of one center: that is 1.5 of the difference.
_SIDE_SIGMAS = 3.0
_SHORTEST_SIDE_SIGMAS = 4.0
# Of a first look, in which a motion is known from three objects only.
_FIRST_SIGMA = 2.0
_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Candidates:
    """Motions, the best first, and where in A they were found."""

    motions: Motions
    anchor: Ints
    """Row of an object of A, shape (m,)."""


def search(a: Objects, target: Target, model: MotionModel, sigma: float) -> Candidates:
    """Return motions that take some objects of A to those of the target within some sigmas."""
    found, anchor = _from_triangles(a, target.objects, model, sigma)
    count = min(_FIRST_NEIGHBORS, len(a))
    from scipy.spatial import cKDTree

    tree = cKDTree(a.centers[:, : model.axes])
    while len(found):
        near = np.atleast_2d(tree.query(a.centers[anchor, : model.axes], k=count)[1])
        near = near.reshape(len(found), count)
        for _ in range(2):
            found, score, partner = _improve(a, target, model, sigma, found, near)
        kept = _distinct(a, found, np.argsort(-score, kind="stable"), sigma)
        if count == len(a):
            kept = kept[_different(partner[kept], _MOST)]
            return Candidates(found[kept], anchor[kept])
        count = min(3 * count, len(a))
        kept = kept[: int(np.clip(_WORK / count, _FEWEST, _FIRST))]
        found, anchor = found[kept], anchor[kept]
    return Candidates(found, anchor)


def _from_triangles(
    a: Objects, b: Objects, model: MotionModel, sigma: float
) -> tuple[Motions, Ints]:
    shortest = _SHORTEST_SIDE_SIGMAS * sigma
    triangles = []
    for objects, both in ((a, True), (b, False)):
        per_anchor = max(_TRIANGLES / len(objects), 15.0)
        neighbors = min(int(0.5 + np.sqrt(2.0 * per_anchor)), len(objects) - 1)
        triangles.append(
            find_triangles(
                objects.centers,
                objects.labels,
                anchors=np.arange(len(objects)),
                neighbors=neighbors,
                model=model,
                shortest=shortest,
                both_orders=both,
            )
        )
    of_a, of_b = triangles
    tolerance = _SIDE_SIGMAS * sigma
    if model.has_scale:  # sides are logarithms of ratios
        tolerance *= float(np.median([np.median(one.per_meter) for one in triangles if len(one)]))
    rows_a, rows_b = match_triangles(of_a, of_b, tolerance, _MATCHES)
    corners_a, corners_b = of_a.corners[rows_a], of_b.corners[rows_b]
    motions = model.fit(a.centers[corners_a], b.centers[corners_b], np.ones(corners_a.shape))
    if len(motions) > _FIRST:
        kept = _most_voted(motions, corners_a[:, 0], corners_b[:, 0], len(b))
        motions, corners_a = motions[kept], corners_a[kept]
    return motions, corners_a[:, 0]


def _most_voted(motions: Motions, anchor_a: Ints, anchor_b: Ints, count_b: int) -> Ints:
    """Return one motion for each pair of anchors and turn, those with the most triangles first."""
    # A turn by its columns, to a tenth of their length: triangles of one pair agree to that.
    turn = np.floor(motions.rotation[:, :, 0] * 3.0 + 0.5).astype(np.int64) + 4
    key = ((anchor_a * count_b + anchor_b) * 9 + turn[:, 0]) * 9 + turn[:, 1]
    _, first, votes = np.unique(key, return_index=True, return_counts=True)
    return np.asarray(first[np.argsort(-votes, kind="stable")][:_FIRST])


def _improve(
    a: Objects, target: Target, model: MotionModel, sigma: float, motions: Motions, near: Ints
) -> tuple[Motions, Floats, Ints]:
    """Fit each motion to the objects (m, n) of A that have a partner in B.

    Also return the scores (m,) of the motions before, and the rows (m, n) of their partners that
    are more likely right than wrong, else -1.
    """
    variance = (_FIRST_SIGMA * sigma) ** 2
    moved = motions.apply(a.centers[near])
    distance, row = target.nearest(moved, a.labels[near], 3.0 * _FIRST_SIGMA * sigma)
    met = np.isfinite(distance)
    row = np.where(met, row, 0)
    square = np.where(met, distance, 0.0) ** 2
    density = np.exp(log_densities(square, np.array(variance), target.axes))
    ratio = np.where(met, density / target.background[row], 0.0)
    score = np.log1p(_SHARE * (ratio - 1.0)).sum(axis=1)
    weight = _SHARE * ratio / (1.0 - _SHARE + _SHARE * ratio)
    fitted = model.fit(a.centers[near], target.objects.centers[row], weight)
    likely = weight > 0.5
    enough = likely.sum(axis=1) >= 3
    keep = [
        np.where(enough.reshape(-1, *(1,) * (old.ndim - 1)), new, old)
        for new, old in (
            (fitted.rotation, motions.rotation),
            (fitted.translation, motions.translation),
            (fitted.scale, motions.scale),
        )
    ]
    return Motions(*keep), score, np.where(likely, row, -1)


def _distinct(a: Objects, motions: Motions, order: Ints, grid: float) -> Ints:
    """Return the rows in an order, without motions that nearly are a better one."""
    middle = np.tile(a.centers.mean(axis=0), (len(motions), 1, 1))
    place = np.floor(motions.apply(middle)[:, 0] / grid)
    cell = np.column_stack([place, np.floor(motions.rotation[:, :, 0] * 50.0)])[order]
    _, first = np.unique(cell, axis=0, return_index=True)
    return np.asarray(order[np.sort(first)])


def _different(partner: Ints, most: int) -> Ints:
    """Return the first rows (k,), at most so many, that pair objects differently: (m, n) of B.

    Motions that share more than half of the pairs of an earlier one would be fitted to the same.
    """
    left = np.ones(len(partner), dtype=np.bool_)
    chosen: list[int] = []
    for row, own in enumerate(partner):
        if not left[row] or len(chosen) == most:
            continue
        chosen.append(row)
        paired = own >= 0
        shared = (partner[:, paired] == own[paired]).sum(axis=1)
        left &= 2 * shared <= paired.sum()
    return np.array(chosen, dtype=np.int64)
