"""How much better sizes fit one object in two maps than two objects of a class.

The logarithms of the semi-axes have three independent parts: how large an object is, how long, and
how flat. Maps repeat each part with an error that the objects show that certainly stayed, and the
objects of a class differ in it by a spread that the classes show. Both begin with what is usual,
which counts as a few objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.places.changes.seen_map import SeenMap

# From the logarithms of descending semi-axes: size, length, flatness.
PARTS = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [1.0, -2.0, 1.0]])
PARTS = PARTS / np.linalg.norm(PARTS, axis=1)[:, None]
# Usual sigmas of the parts: of two maps of one object beside their covariances, and of a class.
REPEATED = np.array([0.26, 0.15, 0.15])
OF_CLASS = np.array([0.7, 0.35, 0.35])
# The number of objects as which these count.
USUAL_COUNT = 3.0
# Two objects differ at least as much as two maps of one do; less would say nothing.
LEAST_VARIANCE = 1e-4


@dataclass(frozen=True, eq=False)
class SizeErrors:
    """Variances of the three parts."""

    repeated: Floats
    """Of two maps of one object, beside their covariances, shape (3,)."""
    of_class: Floats
    """Of the objects of a class, without the errors of their map, shape (3,)."""


def usual_errors(first: SeenMap, second: SeenMap) -> SizeErrors:
    """Return what is known before any object is matched."""
    return SizeErrors(REPEATED**2, _of_class(first, second))


def learned_errors(first: SeenMap, second: SeenMap, pairs: Ints, usual: SizeErrors) -> SizeErrors:
    """Return what pairs of rows (p, 2) show that are the same object."""
    change, variance = _changes(first, second)
    rows, columns = pairs.T
    beside = np.maximum(change[rows, columns] ** 2 - variance[rows, columns], 0.0)
    total = USUAL_COUNT * usual.repeated + beside.sum(axis=0)
    return SizeErrors(
        np.maximum(total / (USUAL_COUNT + len(pairs)), LEAST_VARIANCE), usual.of_class
    )


def log_size_ratio(first: SeenMap, second: SeenMap, errors: SizeErrors) -> Floats:
    """Return the logarithm of the ratio of likelihoods, (a, b)."""
    change, variance = _changes(first, second)
    same = variance + errors.repeated
    other = same + 2.0 * errors.of_class
    ratio = 0.5 * change**2 * (1.0 / other - 1.0 / same) + 0.5 * np.log(other / same)
    return np.asarray(ratio.sum(axis=2))


def _changes(first: SeenMap, second: SeenMap) -> tuple[Floats, Floats]:
    """Return differences of the parts (a, b, 3), and their variances by the maps."""
    one, other = first.log_axes @ PARTS.T, second.log_axes @ PARTS.T
    variances = [(x.log_axes_sigmas**2) @ (PARTS**2).T for x in (first, second)]
    return other[None] - one[:, None], variances[0][:, None] + variances[1][None]


def _of_class(first: SeenMap, second: SeenMap) -> Floats:
    squares, free = USUAL_COUNT * OF_CLASS**2, USUAL_COUNT
    for one in (first, second):
        parts = one.log_axes @ PARTS.T
        errors = (one.log_axes_sigmas**2) @ (PARTS**2).T
        names = np.array(one.class_names)
        for name in sorted(set(one.class_names)):
            own = names == name
            squares = squares + ((parts[own] - parts[own].mean(axis=0)) ** 2).sum(axis=0)
            squares = squares - (own.sum() - 1) * errors[own].mean(axis=0)
            free += float(own.sum() - 1)
    return np.asarray(np.maximum(squares / free, LEAST_VARIANCE))
