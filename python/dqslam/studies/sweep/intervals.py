"""Intervals that hold a true mean, median or share in 95 % of cases, from a sample."""

from collections.abc import Sequence

import numpy as np

CONFIDENCE = 0.95
Interval = tuple[float, float]


def mean_interval(values: Sequence[float]) -> Interval | None:
    """Return Student's t interval, or None for a single value.

    It is exact for a normal quantity, and for others if there are many values. It is symmetric even
    for skewed errors, and may then reach below zero.
    """
    from scipy.stats import t

    if len(values) < 2:
        return None
    sample = np.asarray(values)
    half = t.ppf((1.0 + CONFIDENCE) / 2.0, len(sample) - 1) * sample.std(ddof=1)
    half /= np.sqrt(len(sample))
    return float(sample.mean() - half), float(sample.mean() + half)


def median_interval(values: Sequence[float]) -> Interval | None:
    """Return the narrowest symmetric pair of order statistics that holds the median.

    It is valid for any distribution: each value is below the median with probability 1/2, so the
    number below it is binomial. It is None for fewer than 6 values, where no pair reaches 95 %.
    """
    from scipy.stats import binom

    ordered = np.sort(np.asarray(values))
    # The k-th from either end leaves out the median when fewer than k lie on one of its sides.
    k = int(binom.ppf((1.0 - CONFIDENCE) / 2.0, len(ordered), 0.5))
    if k == 0:
        return None
    return float(ordered[k - 1]), float(ordered[-k])


def share_interval(count: int, total: int) -> Interval | None:
    """Return Wilson's interval of a probability, for `count` events in `total` cases."""
    from scipy.stats import binomtest

    if total == 0:
        return None
    interval = binomtest(count, total).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
