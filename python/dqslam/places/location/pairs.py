"""Which objects the boxes of an image may show, and pairs and triples of them that agree.

The apparent size of an object of known size gives its distance. Two boxes then give the distance of
two objects from each other, which the map knows: most wrong pairs contradict it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import combinations
from typing import Self

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.places.location.place_map import ImageBoxes, PlaceMap

# The least probability of labels for an object among the hypotheses, relative to the best object.
_LEAST_LABEL = 0.1
# Pairs of objects that boxes are compared with, about, and the boxes that are left in any case.
_MOST_COMPARED, _FEWEST_BOXES = 100_000, 3
# If even these boxes would be compared with more pairs, so many agree by chance that sizes and
# distances do not tell the objects apart.
_HOPELESS = 2_000_000
# Sigmas within which distances agree in a small and in a large map, where many do by chance.
AGREE, AGREE_LARGE = 3.0, 2.0
# Relative error of a distance between objects, from their centers in the image and in the map, and
# that of the middle of a box that the border cut.
_DISTANCE_SIGMA, _CUT_SIGMA = 0.05, 0.15
# Sigma of the logarithm of the distance by a box that the border cut.
_CUT_SIZE_SIGMA = 0.4
# Pairs that follow one another, at most, among which triples are looked for.
_MOST_CHAINS = 1_000_000
# A triple of boxes is this much less preferred for each time that each of its boxes was taken.
_USED_AGAIN = 2.0


@dataclass(frozen=True, eq=False)
class Pairings:
    """Boxes with objects that they may show, one row each."""

    box: Ints
    object_row: Ints
    ray: Floats
    """Unit vectors to the middles of the boxes in the camera, shape (n, 3)."""
    log_distance: Floats
    """From the apparent size, shape (n,)."""
    sigma: Floats
    """Of that, shape (n,)."""
    ray_sigma: Floats
    """Relative error of a distance to another object by the error of the ray, shape (n,)."""
    log_odds: Floats
    """Of the labels, against a box that shows none; shape (n,)."""
    center: Floats
    """Of the objects, shape (n, 3)."""

    def __len__(self) -> int:
        """Return the number of pairings."""
        return len(self.box)

    def select(self, rows: Bools) -> Self:
        """Return some of the pairings."""
        return replace(self, **{one.name: getattr(self, one.name)[rows] for one in fields(self)})


def pair_up(place: PlaceMap, camera: _core.Camera, image: ImageBoxes) -> Pairings:
    """List the objects that each box may show by its labels."""
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    side = image.box[:, 2:] - image.box[:, :2]
    ray = np.column_stack(
        [(0.5 * (image.box[:, :2] + image.box[:, 2:]) - middle) / focal, np.ones(len(side))]
    )
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    # A solid angle looks larger by the cube of the cosine at the border of a flat image.
    log_half = 0.5 * np.log((0.5 * side / focal).prod(axis=1)) + 1.5 * np.log(ray[:, 2])
    best = image.log_label.max(axis=1, keepdims=True)
    box, row = np.nonzero(image.log_label > best + np.log(_LEAST_LABEL))
    size = place.size[row]
    cut = np.asarray(image.truncated.any(axis=1))[box]
    return Pairings(
        box=box,
        object_row=row,
        ray=ray[box],
        log_distance=size[:, 0] - log_half[box],
        sigma=np.where(cut, _CUT_SIZE_SIGMA, size[:, 1]),
        ray_sigma=np.where(cut, _CUT_SIGMA, _DISTANCE_SIGMA),
        log_odds=image.log_label[box, row],
        center=place.ellipsoids[row, :3],
    )


def _reaches(pairings: Pairings, boxes: Ints, agree: float) -> Floats:
    """Return the largest distances between objects that two boxes may show, (b, b), meters."""
    of_box = [pairings.box == one for one in boxes.tolist()]
    ray = np.array([pairings.ray[own][0] for own in of_box])
    ends = [pairings.log_distance[own] for own in of_box]
    low, high = np.exp([one.min() for one in ends]), np.exp([one.max() for one in ends])
    error = high * np.array([pairings.sigma[own].max() for own in of_box])
    blur = np.array([pairings.ray_sigma[own][0] for own in of_box])
    cosine = ray @ ray.T
    # The square of the third side is convex in the other two: it is largest at their ends.
    corners = [
        a[:, None] ** 2 + b[None, :] ** 2 - 2.0 * a[:, None] * b[None, :] * cosine
        for a in (low, high)
        for b in (low, high)
    ]
    by_ray = 0.5 * (high[:, None] + high[None, :]) * np.maximum(blur[:, None], blur[None, :])
    sigma = np.sqrt(error[:, None] ** 2 + error[None, :] ** 2 + by_ray**2)
    return np.asarray(np.sqrt(np.maximum(np.max(corners, axis=0), 0.0)) + agree * sigma)


def within_budget(pairings: Pairings, boxes: Ints, agree: float) -> tuple[Ints, Floats]:
    """Return as many of the boxes (b,) as the search has time for, and their reaches (b, b).

    Among thousands of objects of one class, boxes of objects that are near each other are compared
    with few pairs of objects. At least three boxes are returned; or none, if these are too many
    even for them. ``agree`` are the sigmas within which distances agree.
    """
    if not len(boxes):
        return boxes, np.zeros((0, 0))
    reach = _reaches(pairings, boxes, agree)
    count = np.array([np.sum(pairings.box == one) for one in boxes.tolist()], dtype=float)
    area = float(np.sort(np.ptp(pairings.center, axis=0))[-2:].prod())
    share = np.minimum(np.pi * reach**2 / max(area, 1e-12), 1.0)
    cost = count[:, None] * count[None, :] * share
    np.fill_diagonal(cost, 0.0)
    kept = list(range(len(boxes)))
    while len(kept) > _FEWEST_BOXES and cost[np.ix_(kept, kept)].sum() > 2.0 * _MOST_COMPARED:
        kept.pop(int(cost[np.ix_(kept, kept)].sum(axis=1).argmax()))
    if cost[np.ix_(kept, kept)].sum() > 2.0 * _HOPELESS:
        kept = []
    return boxes[kept], reach[np.ix_(kept, kept)]


def agreeing_pairs(pairings: Pairings, boxes: Ints, reach: Floats, agree: float) -> Ints:
    """Return pairs of pairings, the first of the lower box, whose distances agree, shape (p, 2)."""
    from scipy.spatial import cKDTree

    order = np.argsort(boxes)
    boxes, reach = boxes[order], reach[np.ix_(order, order)]
    of_box = [np.flatnonzero(pairings.box == one) for one in boxes.tolist()]
    trees = [cKDTree(pairings.center[one]) for one in of_box]
    found = [np.zeros((0, 2), dtype=np.int64)]
    for a in range(len(of_box)):
        for b in range(a + 1, len(of_box)):
            near = trees[a].sparse_distance_matrix(trees[b], reach[a, b], output_type="ndarray")
            i, j, distance = of_box[a][near["i"]], of_box[b][near["j"]], near["v"]
            found.append(np.column_stack([i, j])[_agrees(pairings, i, j, distance, agree)])
    return np.concatenate(found)


def _agrees(pairings: Pairings, i: Ints, j: Ints, distance: Floats, agree: float) -> Bools:
    """Tell whether objects are as far from each other as their boxes look, shape (p,)."""
    near, far = np.exp(pairings.log_distance[i]), np.exp(pairings.log_distance[j])
    cosine = (pairings.ray[i] * pairings.ray[j]).sum(axis=1)
    square = near**2 + far**2 - 2.0 * near * far * cosine
    seen = np.sqrt(np.maximum(square, 1e-12))
    by_near = near * (near - far * cosine) / seen * pairings.sigma[i]
    by_far = far * (far - near * cosine) / seen * pairings.sigma[j]
    by_ray = 0.5 * (near + far) * np.maximum(pairings.ray_sigma[i], pairings.ray_sigma[j])
    sigma = np.sqrt(by_near**2 + by_far**2 + by_ray**2)
    other = pairings.object_row[i] != pairings.object_row[j]
    return np.asarray(other & (np.abs(seen - distance) < agree * sigma))


def triangles(pairs: Ints, count: int) -> Ints:
    """Return the triangles in the graph of agreeing pairs, shape (t, 3)."""
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    first = np.searchsorted(pairs[:, 0], np.arange(count + 1))
    onward = first[pairs[:, 1] + 1] - first[pairs[:, 1]]  # pairs that begin where each ends
    if onward.sum() > _MOST_CHAINS:  # keep those whose ends have the most neighbors
        degree = np.bincount(pairs.ravel(), minlength=count)
        best = np.argsort(-degree[pairs].min(axis=1), kind="stable")
        keep = best[np.cumsum(onward[best]) <= _MOST_CHAINS]
        return triangles(pairs[keep], count)
    pair = np.repeat(np.arange(len(pairs)), onward)
    step = np.arange(len(pair)) - np.repeat(np.cumsum(onward) - onward, onward)
    third = pairs[first[pairs[pair, 1]] + step, 1]
    known = pairs[:, 0] * count + pairs[:, 1]
    wanted = pairs[pair, 0] * count + third
    place = np.minimum(np.searchsorted(known, wanted), max(len(known) - 1, 0))
    closed = known[place] == wanted if len(known) else np.zeros(0, dtype=bool)
    return np.asarray(np.column_stack([pairs[pair], third])[closed])


def closed(pairings: Pairings, pairs: Ints, triples: Ints, most: int) -> tuple[Ints, Ints]:
    """Keep the triples, and the pairs, with which most other boxes make triples.

    Among thousands of objects, a pair agrees by chance with objects in many places. Boxes that
    agree with both ends at once are fewer, and those of the right place are among them.
    """
    count = len(pairings)
    known = np.sort(pairs[:, 0] * count + pairs[:, 1])
    edges = [
        np.searchsorted(known, triples[:, one] * count + triples[:, two])
        for one, two in ((0, 1), (1, 2), (0, 2))
    ]
    third = pairings.box[triples]
    closes = np.zeros((len(known), int(pairings.box.max()) + 1), dtype=np.bool_)
    for edge, corner in zip(edges, (2, 0, 1), strict=True):
        closes[edge, third[:, corner]] = True
    of_pair = closes.sum(axis=1)
    support = of_pair[edges[0]] + of_pair[edges[1]] + of_pair[edges[2]]
    best = np.argsort(-support, kind="stable")[:most]
    strong = known[np.argsort(-of_pair, kind="stable")[:most]]
    return triples[best], np.column_stack([strong // count, strong % count])


def triples_by_boxes(pairings: Pairings, pairs: Ints, most: int) -> Ints:
    """Return triangles of pairs, (t, 3), of some triples of boxes; about ``most`` of all.

    Among many objects of a class, most triples agree by chance, and nothing tells the right ones
    from these before poses are compared with the other boxes. All triples of a few boxes contain
    the right one, if these boxes show objects of the map: several triples of boxes are taken, those
    of few objects first, and others than before.
    """
    count = len(pairings)
    boxes = np.unique(pairings.box[pairs])
    box = np.searchsorted(boxes, pairings.box[pairs])
    number = np.zeros((len(boxes), len(boxes)))
    np.add.at(number, (box[:, 0], box[:, 1]), 1.0)
    objects = np.bincount(np.searchsorted(boxes, pairings.box[np.isin(pairings.box, boxes)]))
    left = np.array(list(combinations(range(len(boxes)), 3)), dtype=np.int64).reshape(-1, 3)
    sides = [number[left[:, i], left[:, j]] for i, j in ((0, 1), (1, 2), (0, 2))]
    expected = np.prod(sides, axis=0) / np.maximum(objects[left].prod(axis=1), 1)
    used = np.zeros(len(boxes))
    found, total = [np.zeros((0, 3), dtype=np.int64)], 0
    left, expected = left[expected > 0.0], expected[expected > 0.0]
    while len(left) and total < most:
        best = int(np.argmin(expected * _USED_AGAIN ** used[left].sum(axis=1)))
        own = np.isin(box, left[best]).all(axis=1)
        found.append(triangles(pairs[own], count))
        if len(found[-1]) > most:  # evenly spaced ones: they are in the order of the objects
            found[-1] = found[-1][:: -(-len(found[-1]) // most)]
        total += len(found[-1])
        used[left[best]] += 1.0
        left, expected = np.delete(left, best, axis=0), np.delete(expected, best)
    return np.concatenate(found)
