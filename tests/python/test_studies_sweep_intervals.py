"""Intervals against printed tables, another implementation, and their own promise."""

import math

import numpy as np
import pytest

from dqslam.studies.sweep.intervals import mean_interval, median_interval, share_interval


def test_the_interval_of_a_mean_is_students():
    from scipy.stats import ttest_1samp

    values = np.random.default_rng(0).lognormal(size=12)
    expected = ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert mean_interval(values) == pytest.approx((expected.low, expected.high))
    assert mean_interval([2.0]) is None
    assert mean_interval([2.0, 2.0]) == (2.0, 2.0)


@pytest.mark.parametrize(
    ("count", "low", "high"), [(6, 1, 6), (9, 2, 8), (10, 2, 9), (25, 8, 18), (50, 18, 33)]
)
def test_the_interval_of_a_median_is_that_of_printed_tables(count, low, high):
    """Ranks as in tables of the sign test at 95 %."""
    values = np.random.default_rng(count).permutation(np.arange(1.0, count + 1.0))
    assert median_interval(values) == (low, high)


def test_few_values_say_nothing_of_a_median():
    assert median_interval([1.0, 2.0, 3.0, 4.0, 5.0]) is None


def test_intervals_of_medians_hold_what_they_say():
    """Of a skewed distribution whose median is 1, in 95 to 98 % of samples."""
    samples = np.random.default_rng(1).lognormal(sigma=1.5, size=(2000, 20))
    held = [low <= 1.0 <= high for low, high in map(median_interval, samples)]
    assert 0.945 < np.mean(held) < 0.975  # exactly 0.9586 for 20 values


def test_the_interval_of_a_share_is_wilsons():
    z, p, n = 1.959964, 0.1, 20
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert share_interval(2, 20) == pytest.approx((middle - half, middle + half), rel=1e-6)
    assert share_interval(0, 20)[0] == pytest.approx(0.0, abs=1e-12)
    assert share_interval(0, 0) is None
