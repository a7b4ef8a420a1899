"""Poses from which three boxes show three objects: the hypotheses of a search.

The apparent size of an object of known size gives its distance. Two boxes then give the distance of
two objects from each other, which the map knows: most wrong pairs contradict it. Three boxes whose
pairs all agree give a pose, whose distances are corrected until those between the objects are the
map's (the three-point problem of resection, with a start). Where the map shows which way is up, two
boxes give two poses: those in which the camera is not tilted sideways.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.places.locate_map import ImageBoxes, PlaceMap
from dqslam.places.locate_upright import Upright

# The least probability of labels for an object among the hypotheses, relative to the best object.
_LEAST_LABEL = 0.1
# Boxes, at most, that hypotheses set out from.
_MOST_BOXES = 10
# Pairs of objects that boxes are compared with, about, and the boxes that are left in any case.
_MOST_COMPARED, _FEWEST_BOXES = 200_000, 3
# Sigmas within which distances agree.
_AGREE = 3.0
# Relative error of a distance between objects, from their centers in the image and in the map, and
# that of the middle of a box that the border cut.
_DISTANCE_SIGMA, _CUT_SIGMA = 0.05, 0.15
# Sigma of the logarithm of the distance by a box that the border cut.
_CUT_SIZE_SIGMA = 0.4
# Rounds of Newton's method for three distances, and the largest chi-square of these.
_ROUNDS, _MOST_CHI2 = 4, 16.0
# After one round, a larger one does not fall that far.
_HOPELESS_CHI2 = 50.0
# Triples, and pairs that stand, at most, in a small and in a large map: the best of more are taken.
_MOST_TRIPLES, _MOST_TRIPLES_LARGE = 20_000, 3_000
# Pairs that follow one another, at most, among which triples are looked for.
_MOST_CHAINS = 1_000_000
# The least sine of the angle of a triple of objects: three in a line determine no pose.
_LEAST_SINE = 0.1


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


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Poses world_from_camera."""

    rotation: Floats
    """Shape (h, 3, 3)."""
    position: Floats
    """Shape (h, 3)."""


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


def find_hypotheses(
    pairings: Pairings, whole: Bools, upright: Upright | None, *, is_large: bool = False
) -> Hypotheses:
    """Find the poses of all pairs and triples that agree; in a large map, of the best supported.

    ``whole`` (b,) are the boxes without cut edges, which are preferred. Pairs need ``upright``.
    """
    most = _MOST_TRIPLES_LARGE if is_large else _MOST_TRIPLES
    boxes, counts = np.unique(pairings.box, return_counts=True)
    chosen = boxes[np.lexsort((counts, ~whole[boxes]))[:_MOST_BOXES]]
    chosen, reach = _within_budget(pairings, chosen)
    pairs = _agreeing_pairs(pairings, chosen, reach)
    triples = _triples(pairs, len(pairings))
    if is_large and len(triples) > most:
        triples, pairs = _closed(pairings, pairs, triples, most)
    triples = _supported(pairings, pairs, triples, most)
    found = [_resect(pairings, triples)]
    if upright is not None and len(pairs) <= most:
        found.append(_stand(pairings, pairs, upright))
    return Hypotheses(
        np.concatenate([one.rotation for one in found]),
        np.concatenate([one.position for one in found]),
    )


def _reaches(pairings: Pairings, boxes: Ints) -> Floats:
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
    return np.asarray(np.sqrt(np.maximum(np.max(corners, axis=0), 0.0)) + _AGREE * sigma)


def _within_budget(pairings: Pairings, boxes: Ints) -> tuple[Ints, Floats]:
    """Return as many of the boxes (b,) as the search has time for, and their reaches (b, b).

    Among thousands of objects of one class, boxes of objects that are near each other are compared
    with few pairs of objects. At least three boxes are returned.
    """
    if not len(boxes):
        return boxes, np.zeros((0, 0))
    reach = _reaches(pairings, boxes)
    count = np.array([np.sum(pairings.box == one) for one in boxes.tolist()], dtype=float)
    area = float(np.sort(np.ptp(pairings.center, axis=0))[-2:].prod())
    share = np.minimum(np.pi * reach**2 / max(area, 1e-12), 1.0)
    cost = count[:, None] * count[None, :] * share
    np.fill_diagonal(cost, 0.0)
    kept = list(range(len(boxes)))
    while len(kept) > _FEWEST_BOXES and cost[np.ix_(kept, kept)].sum() > 2.0 * _MOST_COMPARED:
        kept.pop(int(cost[np.ix_(kept, kept)].sum(axis=1).argmax()))
    return boxes[kept], reach[np.ix_(kept, kept)]


def _agreeing_pairs(pairings: Pairings, boxes: Ints, reach: Floats) -> Ints:
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
            found.append(np.column_stack([i, j])[_agrees(pairings, i, j, distance)])
    return np.concatenate(found)


def _agrees(pairings: Pairings, i: Ints, j: Ints, distance: Floats) -> Bools:
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
    return np.asarray(other & (np.abs(seen - distance) < _AGREE * sigma))


def _triples(pairs: Ints, count: int) -> Ints:
    """Return the triangles in the graph of agreeing pairs, shape (t, 3)."""
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    first = np.searchsorted(pairs[:, 0], np.arange(count + 1))
    onward = first[pairs[:, 1] + 1] - first[pairs[:, 1]]  # pairs that begin where each ends
    if onward.sum() > _MOST_CHAINS:  # keep those whose ends have the most neighbors
        degree = np.bincount(pairs.ravel(), minlength=count)
        best = np.argsort(-degree[pairs].min(axis=1), kind="stable")
        keep = best[np.cumsum(onward[best]) <= _MOST_CHAINS]
        return _triples(pairs[keep], count)
    pair = np.repeat(np.arange(len(pairs)), onward)
    step = np.arange(len(pair)) - np.repeat(np.cumsum(onward) - onward, onward)
    third = pairs[first[pairs[pair, 1]] + step, 1]
    known = pairs[:, 0] * count + pairs[:, 1]
    wanted = pairs[pair, 0] * count + third
    place = np.minimum(np.searchsorted(known, wanted), max(len(known) - 1, 0))
    closed = known[place] == wanted if len(known) else np.zeros(0, dtype=bool)
    return np.asarray(np.column_stack([pairs[pair], third])[closed])


def _closed(pairings: Pairings, pairs: Ints, triples: Ints, most: int) -> tuple[Ints, Ints]:
    """Keep the triples, and the pairs, with which most other boxes make triples.

    Among thousands of objects, a pair agrees by chance with objects in many places. Boxes that agree
    with both ends at once are fewer, and those of the right place are among them.
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


def _supported(pairings: Pairings, pairs: Ints, groups: Ints, most: int) -> Ints:
    """Keep the groups (t, k) whose pairings agree with most other boxes, if there are very many."""
    if len(groups) <= most:
        return groups
    agrees = np.zeros((len(pairings), int(pairings.box.max()) + 1), dtype=np.bool_)
    for one, other in ((0, 1), (1, 0)):
        agrees[pairs[:, one], pairings.box[pairs[:, other]]] = True
    support = agrees.sum(axis=1)[groups].sum(axis=1)
    return groups[np.argsort(-support, kind="stable")[:most]]


def _resect(pairings: Pairings, triples: Ints) -> Hypotheses:
    """Return the poses of triples (t, 3) whose objects are not in a line and fit their boxes."""
    different = pairings.object_row[triples]
    triples = triples[(different[:, 0] != different[:, 2])]
    world, ray = pairings.center[triples], pairings.ray[triples]
    one, two = world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    bent = np.linalg.norm(np.cross(one, two), axis=1) > _LEAST_SINE * lengths
    triples, world, ray = triples[bent], world[bent], ray[bent]
    _, chi2 = _solve_distances(pairings, triples, rounds=1)
    triples, world, ray = (one[chi2 < _HOPELESS_CHI2] for one in (triples, world, ray))
    log_distance, chi2 = _solve_distances(pairings, triples)
    fits = np.flatnonzero(chi2 < _MOST_CHI2)
    if len(fits) > _MOST_TRIPLES:
        fits = fits[np.argsort(chi2[fits], kind="stable")[:_MOST_TRIPLES]]
    camera = ray[fits] * np.exp(log_distance[fits])[:, :, None]
    world = world[fits]
    rotation = np.asarray(_frames(world) @ _frames(camera).transpose(0, 2, 1))
    middle = np.einsum("tij,tj->ti", rotation, camera.mean(axis=1))
    return Hypotheses(rotation, world.mean(axis=1) - middle)


def _stand(pairings: Pairings, pairs: Ints, upright: Upright) -> Hypotheses:
    """Return the poses of pairs (p, 2) in which the camera's x axis is horizontal."""
    log_distance, chi2 = _solve_distances(pairings, pairs)
    fits = chi2 < _MOST_CHI2
    world = pairings.center[pairs[fits]]
    camera = pairings.ray[pairs[fits]] * np.exp(log_distance[fits])[:, :, None]
    # The first axis of these frames joins both objects. A turn about it is open.
    to_world, to_camera = _axis_frames(world), _axis_frames(camera)
    up, x = upright.up @ to_world, to_camera[:, 0, :]
    # x . R^T up = a + b cos + c sin = 0 of the angle of the turn
    a = up[:, 0] * x[:, 0]
    b = up[:, 1] * x[:, 1] + up[:, 2] * x[:, 2]
    c = up[:, 2] * x[:, 1] - up[:, 1] * x[:, 2]
    reach = np.hypot(b, c)
    half = np.arccos(np.clip(-a / np.maximum(reach, 1e-12), -1.0, 1.0))
    rotations, positions = [], []
    for sign in (1.0, -1.0):
        angle = np.arctan2(c, b) + sign * half
        turn = np.zeros((len(angle), 3, 3))
        turn[:, 0, 0] = 1.0
        turn[:, 1, 1] = turn[:, 2, 2] = np.cos(angle)
        turn[:, 2, 1], turn[:, 1, 2] = np.sin(angle), -np.sin(angle)
        rotation = to_world @ turn @ to_camera.transpose(0, 2, 1)
        is_up = upright.up @ rotation[:, :, 1].T < 0.0
        rotations.append(rotation[is_up])
        middle = np.einsum("tij,tj->ti", rotation, camera.mean(axis=1))
        positions.append((world.mean(axis=1) - middle)[is_up])
    return Hypotheses(np.concatenate(rotations), np.concatenate(positions))


def _solve_distances(
    pairings: Pairings, groups: Ints, *, rounds: int = _ROUNDS
) -> tuple[Floats, Floats]:
    """Find the distances whose differences are the map's, near those of the apparent sizes.

    The groups (t, k) are pairs or triples. Return the logarithms of the distances (t, k) and the
    chi-square of each group (t,).
    """
    start, sigma = pairings.log_distance[groups], pairings.sigma[groups]
    ray, world, blur = pairings.ray[groups], pairings.center[groups], pairings.ray_sigma[groups]
    first, second = np.triu_indices(groups.shape[1], 1)
    cosine = (ray[:, first] * ray[:, second]).sum(axis=2)
    known = np.linalg.norm(world[:, first] - world[:, second], axis=2)
    relative = 0.5 * np.maximum(blur[:, first], blur[:, second])
    log_distance = start.copy()
    for last in [False] * rounds + [True]:
        distance = np.exp(log_distance)
        a, b = distance[:, first], distance[:, second]
        seen = np.sqrt(np.maximum(a**2 + b**2 - 2.0 * a * b * cosine, 1e-12))
        scale = relative * (a + b)
        error = (seen - known) / scale
        prior = (log_distance - start) / sigma
        if last:
            break
        jacobian = np.zeros((*error.shape, groups.shape[1]))
        row = np.arange(len(first))
        jacobian[:, row, first] = a * (a - b * cosine) / seen / scale
        jacobian[:, row, second] = b * (b - a * cosine) / seen / scale
        transposed = jacobian.transpose(0, 2, 1)
        hessian = transposed @ jacobian + np.eye(groups.shape[1]) / sigma[:, :, None] ** 2
        gradient = (transposed @ error[:, :, None])[:, :, 0] + prior / sigma
        step = np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        log_distance = log_distance - np.clip(step, -0.5, 0.5)
    return log_distance, np.asarray((error**2).sum(axis=1) + (prior**2).sum(axis=1))


def _axis_frames(points: Floats) -> Floats:
    """Return a right-handed frame for each pair (p, 2, 3), whose x axis joins the points."""
    x = points[:, 1] - points[:, 0]
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    across = np.eye(3)[np.abs(x).argmin(axis=1)]
    z = np.cross(x, across)
    z = z / np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _frames(points: Floats) -> Floats:
    """Return the axes of a right-handed frame of each triangle (t, 3, 3) in columns."""
    x = points[:, 1] - points[:, 0]
    z = np.cross(x, points[:, 2] - points[:, 0])
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    z = z / np.maximum(np.linalg.norm(z, axis=1, keepdims=True), 1e-12)
    return np.stack([x, np.cross(z, x), z], axis=2)
