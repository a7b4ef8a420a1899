"""Poses from which three boxes show three objects: the hypotheses of a search.

Three boxes whose pairs all agree give a pose, whose distances are corrected until those between the
objects are the map's (the three-point problem of resection, with a start). Where the map shows
which way is up, two boxes give two poses: those in which the camera is not tilted sideways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.places.location.pairs import (
    AGREE,
    AGREE_LARGE,
    Pairings,
    agreeing_pairs,
    closed,
    triangles,
    triples_by_boxes,
    within_budget,
)
from dqslam.places.upright import Upright

# Boxes, at most, that hypotheses set out from.
_MOST_BOXES = 10
# Rounds of Newton's method for three distances, and the largest chi-square of these.
_ROUNDS, _MOST_CHI2 = 4, 16.0
# After one round, a larger one does not fall that far.
_HOPELESS_CHI2 = 50.0
# Triples that poses are found of, at most, in a small and in a large map.
_MOST_TRIPLES, _MOST_TRIPLES_LARGE = 16_000, 3_000
# Poses of triples, and pairs that stand, at most: the best of more are taken.
_MOST_POSES = 4_000
# The least sine of the angle of a triple of objects: three in a line determine no pose.
_LEAST_SINE = 0.1


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Poses world_from_camera."""

    rotation: Floats
    """Shape (h, 3, 3)."""
    position: Floats
    """Shape (h, 3)."""
    is_given_up: bool = False
    """Whether there are too many objects alike to look for poses."""


def find_hypotheses(
    pairings: Pairings, whole: Bools, upright: Upright | None, *, is_large: bool = False
) -> Hypotheses:
    """Find the poses of pairs and triples that agree; in a large map, of the best supported.

    ``whole`` (b,) are the boxes without cut edges, which are preferred. Pairs need ``upright``.
    """
    agree = AGREE_LARGE if is_large else AGREE
    boxes, counts = np.unique(pairings.box, return_counts=True)
    chosen = boxes[np.lexsort((counts, ~whole[boxes]))[:_MOST_BOXES]]
    affordable, reach = within_budget(pairings, chosen, agree)
    is_given_up = len(affordable) < len(chosen) and not len(affordable)
    chosen = affordable
    pairs = agreeing_pairs(pairings, chosen, reach, agree)
    if is_large:
        most = _MOST_TRIPLES_LARGE
        triples = triangles(pairs, len(pairings))
        if len(triples) > most:
            triples, pairs = closed(pairings, pairs, triples, most)
    else:
        most = _MOST_POSES
        triples = triples_by_boxes(pairings, pairs, _MOST_TRIPLES)
    found = [_resect(pairings, triples, upright)]
    if upright is not None and len(pairs) <= most:
        found.append(_stand(pairings, pairs, upright))
    return Hypotheses(
        np.concatenate([one.rotation for one in found]),
        np.concatenate([one.position for one in found]),
        is_given_up,
    )


def _resect(pairings: Pairings, triples: Ints, upright: Upright | None) -> Hypotheses:
    """Return the poses of triples (t, 3) whose objects are not in a line and fit their boxes.

    Of very many, those that fit best are taken, with regard to how cameras are tilted.
    """
    different = pairings.object_row[triples]
    triples = triples[(different[:, 0] != different[:, 2])]
    world, ray = pairings.center[triples], pairings.ray[triples]
    one, two = world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    bent = np.linalg.norm(np.cross(one, two), axis=1) > _LEAST_SINE * lengths
    triples, world, ray = triples[bent], world[bent], ray[bent]
    log_distance, chi2 = _solve_distances(pairings, triples, rounds=1)
    hopeful = np.flatnonzero(chi2 < _HOPELESS_CHI2)
    if len(hopeful) > 2 * _MOST_POSES:
        hopeful = hopeful[np.argsort(chi2[hopeful], kind="stable")[: 2 * _MOST_POSES]]
    triples, world, ray = triples[hopeful], world[hopeful], ray[hopeful]
    log_distance, chi2 = _solve_distances(
        pairings, triples, rounds=_ROUNDS - 1, begin=log_distance[hopeful]
    )
    fits = np.flatnonzero(chi2 < _MOST_CHI2)
    camera = ray[fits] * np.exp(log_distance[fits])[:, :, None]
    world = world[fits]
    rotation = np.asarray(_frames(world) @ _frames(camera).transpose(0, 2, 1))
    if len(fits) > _MOST_POSES:
        misfit = chi2[fits]
        if upright is not None:
            misfit = misfit - 2.0 * upright.log_prior(rotation)
        best = np.argsort(misfit, kind="stable")[:_MOST_POSES]
        camera, world, rotation = camera[best], world[best], rotation[best]
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
    pairings: Pairings, groups: Ints, *, rounds: int = _ROUNDS, begin: Floats | None = None
) -> tuple[Floats, Floats]:
    """Find the distances whose differences are the map's, near those of the apparent sizes.

    The groups (t, k) are pairs or triples. Newton's method begins at those of the apparent sizes or
    at ``begin`` (t, k), logarithms. Return the logarithms of the distances (t, k) and the
    chi-square of each group (t,).
    """
    start, sigma = pairings.log_distance[groups], pairings.sigma[groups]
    ray, world, blur = pairings.ray[groups], pairings.center[groups], pairings.ray_sigma[groups]
    first, second = np.triu_indices(groups.shape[1], 1)
    cosine = (ray[:, first] * ray[:, second]).sum(axis=2)
    known = np.linalg.norm(world[:, first] - world[:, second], axis=2)
    relative = 0.5 * np.maximum(blur[:, first], blur[:, second])
    log_distance = start if begin is None else begin
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
