"""Intervals that hold a true mean, median or share in 95 % of cases, from a sample."""

from collections.abc import Sequence

import numpy as np

CONFIDENCE = 0.95
Interval = tuple[float, float]


def mean_interval(values: Sequence[float]) -> Interval | None:
    """Return Student's t interval: exact for a normal quantity, else for many values; None for one.

    An interval of errors that are skewed is symmetric nonetheless, and may reach below zero.
    """
    from scipy.stats import t

    if len(values) < 2:
        return None
    sample = np.asarray(values)
    half = t.ppf((1.0 + CONFIDENCE) / 2.0, len(sample) - 1) * sample.std(ddof=1)
    half /= np.sqrt(len(sample))
    return float(sample.mean() - half), float(sample.mean() + half)


def median_interval(values: Sequence[float]) -> Interval | None:
    """Return the narrowest pair of order statistics, as far from either end, that holds the median.

    Whatever the distribution: each value is below its median with probability 1/2, so that the
    number below is binomial. None for fewer than 6 values, which no pair of them is sure of.
    """
    from scipy.stats import binom

    ordered = np.sort(np.asarray(values))
    # The k-th from either end leaves out the median when fewer than k lie on one of its sides.
    k = int(binom.ppf((1.0 - CONFIDENCE) / 2.0, len(ordered), 0.5))
    if k == 0:
        return None
    return float(ordered[k - 1]), float(ordered[-k])


def share_interval(count: int, total: int) -> Interval | None:
    """Return Wilson's interval of a probability of which `count` of `total` cases came true."""
    from scipy.stats import binomtest

    if total == 0:
        return None
    interval = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
