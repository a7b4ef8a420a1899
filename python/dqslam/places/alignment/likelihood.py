"""How much better one place explains two maps than chance does.

An object of map A that is moved into map B is in B with probability q. If it is, its nearest
object of the class is where the errors of both maps let it be, with a density N of their distance.
If it is not, the objects of B are where they are for other reasons, with the density
``background`` around them. The likelihood ratio of one object is ``1 - q + q N / background``. Its
mean over random maps of that density is 1, whatever q and the errors are, and so is the mean over a
grid of both: a ratio of e^s comes by chance once in e^s motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.places.alignment.rigid import MotionModel

SHARES = np.array([0.1, 0.3, 0.6, 0.9])
"""Shares of the objects of one map, where the other map is, that the other has, too."""
SPREADS = 4.0 ** np.arange(-3.0, 2.0)
"""Factors on the variances of the files, or on the assumed ones."""
_NEIGHBORS = 6  # of the local density: fewer are noisy, more are not local
# An object farther from all objects of B than this many spacings is outside of B.
_OUTSIDE = 3.0
_LARGEST_LOG = 500.0  # of a ratio, before it would overflow
_LEAST_RATIO = -3.0  # logarithm for one height or size: some are simply wrong


@dataclass(frozen=True, eq=False)
class Objects:
    """Objects of a map as the search needs them."""

    centers: Floats
    """Meters, shape (o, 3)."""
    labels: Ints
    """Numbers of the classes, the same in both maps, shape (o,)."""
    variance: Floats
    """Of one coordinate of the center, square meters, shape (o,)."""
    size: Floats
    """Mean logarithm of the semi-axes, shape (o,); NaN if unknown."""
    size_variance: Floats
    """Shape (o,)."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.labels)


def spacing(centers: Floats, axes: int) -> float:
    """Return the side of the square (cube) that an object has for itself where it stands."""
    from scipy.spatial import cKDTree

    places = centers[:, :axes]
    k = min(_NEIGHBORS, len(places) - 1)
    if k < 1:
        return 1.0
    radius = cKDTree(places).query(places, k=k + 1)[0][:, -1]
    return float((_ball(axes) * np.median(radius) ** axes / k) ** (1.0 / axes))


def _ball(axes: int) -> float:
    return float(np.pi if axes == 2 else 4.0 / 3.0 * np.pi)


class Target:
    """Map B: its nearest object of a class, and how dense its objects are."""

    def __init__(self, objects: Objects, model: MotionModel, spacing_m: float) -> None:
        """Prepare the look-up of nearest objects."""
        from scipy.spatial import cKDTree

        self.objects, self.axes = objects, model.axes
        self._outside = _OUTSIDE * spacing_m
        places = objects.centers[:, : self.axes]
        extent = places.max(axis=0) - places.min(axis=0)
        self.size_m = float(np.linalg.norm(extent))
        # Classes are planes that are farther apart than any distance that is asked for.
        self._apart = 1e3 * (self.size_m + spacing_m)
        self._tree = cKDTree(np.column_stack([places, self._apart * objects.labels]))
        self._any = cKDTree(places)
        self.background = self._densities(places, np.prod(np.maximum(extent, spacing_m)))

    def _densities(self, places: Floats, volume: float) -> Floats:
        """Return the density of the class around each object, without itself; (o,)."""
        from scipy.spatial import cKDTree

        density = np.full(len(places), 1.0 / volume)
        for label in np.unique(self.objects.labels):
            rows = np.flatnonzero(self.objects.labels == label)
            k = min(_NEIGHBORS, len(rows) - 1)
            if k < 1:
                continue
            radius = cKDTree(places[rows]).query(places[rows], k=k + 1)[0][:, -1]
            local = k / np.maximum(_ball(self.axes) * radius**self.axes, 1e-300)
            density[rows] = np.maximum(local, len(rows) / volume)
        return density

    def nearest(self, points: Floats, labels: Ints, within: float) -> tuple[Floats, Ints]:
        """Return distance and row of the nearest object of the class; infinite and o for none."""
        shape = labels.shape
        query = np.column_stack(
            [points[..., : self.axes].reshape(-1, self.axes), self._apart * labels.ravel()]
        )
        distance, row = self._tree.query(query, distance_upper_bound=within)
        return distance.reshape(shape), row.reshape(shape)

    def covers(self, points: Floats) -> Bools:
        """Return whether points (n, 3) are where map B is, shape (n,)."""
        distance, _ = self._any.query(points[:, : self.axes], distance_upper_bound=self._outside)
        return np.asarray(np.isfinite(distance))


def log_densities(square: Floats, variance: Floats, axes: int) -> Floats:
    """Return the logarithm of the normal density of squared distances."""
    return np.asarray(-0.5 * square / variance - 0.5 * axes * np.log(2.0 * np.pi * variance))


def log_student(square: Floats, variance: Floats, axes: int, freedom: float) -> Floats:
    """Return the logarithm of Student's density of squared distances."""
    from scipy.special import gammaln

    half = 0.5 * (freedom + axes)
    constant = gammaln(half) - gammaln(0.5 * freedom) - 0.5 * axes * np.log(freedom * np.pi)
    spread = -0.5 * axes * np.log(variance)
    return np.asarray(constant + spread - half * np.log1p(square / (freedom * variance)))


def attribute_ratio(difference: Floats, variance: Floats, spread: float) -> Floats:
    """Return log ratios of one attribute, such as height: of one object, against of any two.

    ``spread`` is the variance of the difference of two objects that have nothing to do with each
    other. NaN differences, of unknown attributes, say nothing.
    """
    total = variance + spread
    ratio = 0.5 * np.log(total / variance) - 0.5 * difference**2 * (1.0 / variance - 1.0 / total)
    return np.nan_to_num(np.maximum(ratio, _LEAST_RATIO), nan=0.0)


def evidence(log_ratio: Floats, covered: Bools) -> tuple[float, Floats, Floats, int]:
    """Sum the ratios of all objects over the grid; log_ratio has shape (spreads, o).

    Objects of A without a partner have -inf. Returns the logarithm of the mean likelihood ratio
    and, at the best entry of the grid, the probability of each pair to be right, the part of each
    object, and the row of the spread.
    """
    ratio = np.exp(np.minimum(log_ratio, _LARGEST_LOG))
    terms = np.log1p(SHARES[:, None, None] * (ratio[None] - 1.0))
    terms = np.where(covered, terms, 0.0)
    total = terms.sum(axis=2)
    share, spread = np.unravel_index(int(np.argmax(total)), total.shape)
    peak = total[share, spread]
    mean = float(peak + np.log(np.exp(total - peak).mean()))
    weight = SHARES[share] * ratio[spread]
    probability = weight / (1.0 - SHARES[share] + weight)
    return mean, probability, terms[share, spread], int(spread)


def tangent(places: Floats, model: MotionModel) -> Floats:
    """Return the derivatives of places by a motion: x y z, then turns, then log scale.

    Turns are about z alone if upright, else about x y z. Shape (o, 3, 4 or 6, plus 1 with scale).
    """
    count = len(places)
    x, y, z = places.T
    turns = np.zeros((count, 3, 3))
    turns[:, 1, 0], turns[:, 2, 0] = -z, y
    turns[:, 0, 1], turns[:, 2, 1] = z, -x
    turns[:, 0, 2], turns[:, 1, 2] = -y, x
    parts = [np.tile(np.eye(3), (count, 1, 1)), turns[:, :, 2:] if model.upright else turns]
    if model.has_scale:
        parts.append(places[:, :, None])
    return np.concatenate(parts, axis=2)
