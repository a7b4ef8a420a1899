"""The direction up, from the lowest points of objects that stand on horizontal planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.estimate import Estimate
from dqslam.placements.lowest_points import (
    gradients_by_objects,
    height_sigmas,
    lowest_points,
    support_points,
    tangents,
    tilt_between,
    turned,
)
from dqslam.placements.planes import GATE, find_planes

# Steps of Gauss-Newton, in each of which planes are found anew, and the step [rad] that ends them.
_STEPS, _SMALL = 20, 1e-6
# Directions to start at: normals of planes through three objects, of so many objects whose lowest
# points are known best, within so many prior sigmas. The best that differ by so much [rad] are fit.
_BEST_OBJECTS, _MOST_TRIPLES, _REACH = 40, 300, 3.0
_MOST_STARTS, _DIFFERENT = 5, 0.05
# Directions closer than this [rad] are one minimum.
_SAME = 1e-3


@dataclass(frozen=True)
class UpDirection:
    """A direction up that is known with some uncertainty."""

    direction: Floats
    """Unit vector in the world, shape (3,)."""
    covariance: Floats
    """Radians squared, shape (3, 3); 0 along the direction."""

    @staticmethod
    def with_sigma(direction: Floats, sigma: float) -> UpDirection:
        """Return a direction (3,) that is off by so many radians about each horizontal axis."""
        unit = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
        return UpDirection(unit, sigma**2 * (np.eye(3) - np.outer(unit, unit)))

    @property
    def sigma(self) -> float:
        """Standard deviation of the tilt about its least certain axis, radians."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))

    def one_sigma_away(self) -> Floats:
        """Return two directions (2, 3), each a standard deviation away along a principal axis."""
        variances, axes = np.linalg.eigh(self.covariance)
        sigmas = np.sqrt(variances.clip(min=0.0))
        return np.array([turned(self.direction, sigmas[k] * axes[:, k]) for k in (1, 2)])


@dataclass(frozen=True)
class Supported:
    """The objects of a rule that puts them on planes."""

    rows: Ints
    """Rows of the estimate."""
    sigma: float
    """Meters."""
    several: bool
    """Whether there may be more planes than one."""


@dataclass(frozen=True)
class _Fit:
    direction: Floats
    covariance: Floats
    cost: float
    """Chi-square of the lowest points and of the prior; objects on no plane cost the gate."""


@dataclass(frozen=True)
class _Found:
    """The objects on planes, at one direction."""

    rows: Ints
    """Of the estimate, shape (k,)."""
    planes: Ints
    """Number of the plane of each, shape (k,)."""
    sigmas: Floats
    """Of the rule of each, meters, shape (k,)."""
    left_over: int
    """Objects of rules that are on no plane."""


def estimate_up(
    estimate: Estimate, covariance: Floats, rules: Sequence[Supported], prior: UpDirection
) -> UpDirection:
    """Estimate the direction up from an estimate that does not know the planes.

    With errors so small that the lowest points are linear in them, this is the direction of the
    most probable poses, objects, planes and direction together, of which all but the direction are
    eliminated.

    Parameters
    ----------
    estimate
        Objects, without the rules.
    covariance
        Of the parameters of all its objects together, shape (9 o, 9 o).
    rules
        The objects that stand on planes.
    prior
        What is known of the direction without planes.

    Returns
    -------
    UpDirection
        The covariance reaches to other directions, too, at which objects stand on planes nearly as
        well. Without a plane, the result is the prior.
    """
    fits = [
        _fit(estimate, covariance, rules, prior, start)
        for start in _starts(estimate, covariance, rules, prior)
    ]
    fits.sort(key=lambda fit: fit.cost)
    best, distinct = fits[0], list[_Fit]()
    for fit in fits:
        if all(np.linalg.norm(fit.direction - other.direction) > _SAME for other in distinct):
            distinct.append(fit)
    weights = np.exp(-0.5 * np.array([fit.cost - best.cost for fit in distinct]))
    away = [tilt_between(best.direction, fit.direction) for fit in distinct]
    spread = [fit.covariance + np.outer(one, one) for fit, one in zip(distinct, away, strict=True)]
    flat = np.eye(3) - np.outer(best.direction, best.direction)
    return UpDirection(best.direction, flat @ np.average(spread, axis=0, weights=weights) @ flat)


def _starts(
    estimate: Estimate, covariance: Floats, rules: Sequence[Supported], prior: UpDirection
) -> list[Floats]:
    """Return the prior's direction, and those at which most objects seem to stand on planes."""
    points = support_points(estimate, prior.direction)
    sigmas = _sigmas(estimate, covariance, prior.direction)
    normals: list[Floats] = []
    for rule in rules:
        known = rule.rows[np.argsort(sigmas[rule.rows], kind="stable")][:_BEST_OBJECTS]
        triples = list(combinations(known.tolist(), 3))
        for triple in triples[:: max(1, -(-len(triples) // _MOST_TRIPLES))]:
            a, b, c = points[list(triple)]
            normal = np.cross(b - a, c - a)
            length = float(np.linalg.norm(normal))
            if length > 0.0:
                normals.append(normal * np.sign(normal @ prior.direction) / length)
    known_tilt = np.linalg.pinv(prior.covariance)
    costs: list[tuple[float, int]] = []
    for number, normal in enumerate(normals):
        tilt = tilt_between(prior.direction, normal)
        unlikely = float(tilt @ known_tilt @ tilt)
        if unlikely <= _REACH**2:
            heights = points @ normal
            found = _planes(heights, sigmas, rules)
            costs.append((unlikely + _misfit(heights, sigmas, found), number))
    chosen = [prior.direction]
    for _, number in sorted(costs):
        if len(chosen) > _MOST_STARTS:
            break
        if all(np.linalg.norm(normals[number] - one) > _DIFFERENT for one in chosen[1:]):
            chosen.append(normals[number])
    return chosen


def _sigmas(estimate: Estimate, covariance: Floats, up: Floats) -> Floats:
    blocks = covariance.reshape(len(covariance) // 9, 9, -1, 9)
    own = np.einsum("ijik->ijk", blocks)
    return height_sigmas(gradients_by_objects(estimate, up), own)


def _planes(heights: Floats, sigmas: Floats, rules: Sequence[Supported]) -> _Found:
    rows: list[Ints] = []
    planes: list[Ints] = []
    of_rules: list[Floats] = []
    count, left_over = 0, 0
    for rule in rules:
        sure = np.hypot(rule.sigma, sigmas[rule.rows])
        left_over += len(rule.rows)
        for plane in find_planes(heights[rule.rows], sure, rule.several):
            rows.append(rule.rows[plane.rows])
            planes.append(np.full(len(plane.rows), count))
            of_rules.append(np.full(len(plane.rows), rule.sigma))
            left_over -= len(plane.rows)
            count += 1
    if not rows:
        return _Found(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), left_over)
    return _Found(np.concatenate(rows), np.concatenate(planes), np.concatenate(of_rules), left_over)


def _misfit(heights: Floats, sigmas: Floats, found: _Found) -> float:
    """Return the chi-square of independent heights, each plane at the mean of its objects."""
    cost = GATE**2 * found.left_over
    for plane in np.unique(found.planes):
        own = found.planes == plane
        weights = 1.0 / (found.sigmas[own] ** 2 + sigmas[found.rows[own]] ** 2)
        off = heights[found.rows[own]] - np.average(heights[found.rows[own]], weights=weights)
        cost += float(weights @ off**2)
    return cost


def _fit(
    estimate: Estimate,
    covariance: Floats,
    rules: Sequence[Supported],
    prior: UpDirection,
    start: Floats,
) -> _Fit:
    """Return the most probable direction near a start, by Gauss-Newton."""
    known_tilt = np.linalg.pinv(prior.covariance)
    up = start
    gradients = gradients_by_objects(estimate, up)
    sigmas = _sigmas(estimate, covariance, up)
    for _ in range(_STEPS):
        axes = tangents(up)
        heights = lowest_points(estimate, up)
        found = _planes(heights, sigmas, rules)
        information = axes @ known_tilt @ axes.T
        off = -axes @ tilt_between(up, prior.direction)
        gradient = information @ off
        cost = float(off @ gradient) + GATE**2 * found.left_over
        if len(found.rows):
            points = support_points(estimate, up) @ axes.T
            tilted, rest = _without_heights(heights, points, gradients, covariance, found)
            information = information + tilted.T @ tilted
            gradient = gradient + tilted.T @ rest
            cost += float(rest @ rest)
        step = -np.linalg.solve(information, gradient)
        up = turned(up, step @ axes)
        if float(np.linalg.norm(step)) < _SMALL:
            break
    return _Fit(up, axes.T @ np.linalg.inv(information) @ axes, cost)


def _without_heights(
    heights: Floats, points: Floats, gradients: Floats, covariance: Floats, found: _Found
) -> tuple[Floats, Floats]:
    """Return derivatives (k, 2) by the tilt and residuals (k,) of objects on planes, whitened.

    The heights of the planes, which are unknown, are eliminated.
    """
    count = len(found.rows)
    jacobian = np.zeros((count, len(gradients), 9))
    jacobian[np.arange(count), found.rows] = gradients[found.rows]
    flat = jacobian.reshape(count, -1)
    factor = np.linalg.cholesky(flat @ covariance @ flat.T + np.diag(found.sigmas**2))
    level = np.linalg.solve(factor, np.eye(int(found.planes.max()) + 1)[found.planes])
    basis = np.linalg.qr(level)[0]
    rest = np.linalg.solve(factor, np.column_stack([points[found.rows], heights[found.rows]]))
    rest = rest - basis @ (basis.T @ rest)
    return rest[:, :2], rest[:, 2]
