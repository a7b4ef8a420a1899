import numpy as np
import pytest

from dqslam.association.repetition import (
    PRIOR_EDGES,
    RepeatedNoise,
    Whitener,
    corrected_variances,
)
from dqslam.assumptions import BoxNoise

NOISE = RepeatedNoise(BoxNoise(0.5, 0.01), BoxNoise(1.2, 0.03), angle=0.5)


def test_both_parts_add_up_to_what_one_box_has():
    total = NOISE.total
    assert total.pixels == pytest.approx(1.3)
    assert total.relative == pytest.approx(np.sqrt(0.001))
    new, repeated = NOISE.edge_variances(np.array([100.0]))
    assert new[0] == pytest.approx(0.25 + 1.0)
    assert repeated[0] == pytest.approx(1.44 + 9.0)


def test_views_are_alike_by_angle_and_distance():
    towards = np.array([[0.0, 0.0, 1.0], [0.0, np.sin(0.5), np.cos(0.5)], [0.0, 0.0, np.exp(0.5)]])
    correlation = NOISE.correlation(towards)
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    assert correlation[0, 1] == pytest.approx(np.exp(-1.0))  # 0.5 rad apart
    assert correlation[0, 2] == pytest.approx(np.exp(-1.0))  # farther by a factor of e^0.5
    assert correlation[1, 2] == pytest.approx(np.exp(-np.sqrt(2.0)))
    np.testing.assert_allclose(NOISE.correlation(towards, towards[1:]), correlation[:, 1:])


def test_many_boxes_from_one_side_tell_no_more_than_what_repeats():
    """The information on a common error of n boxes is n / (new + n repeated)."""
    n, side = 40, 100.0
    whitener = Whitener.of(
        NOISE, np.ones((n, n)), np.full((4, n), side), np.ones(n), np.ones((4, n), dtype=bool)
    )
    expected = n / (1.25 + n * 10.44)
    np.testing.assert_allclose(whitener.precision.sum(axis=(1, 2)), expected)
    # Their differences are as sure as what is new lets them be.
    difference = np.zeros(n)
    difference[:2] = [1.0, -1.0]
    information = difference @ whitener.precision[0] @ difference / 4.0
    assert information == pytest.approx(2.0 / 1.25 / 4.0)


def test_edges_that_tell_nothing_have_no_information():
    counts = np.ones((4, 3), dtype=bool)
    counts[2, 1] = False
    correlation = NOISE.correlation(np.random.default_rng(0).normal(size=(3, 3)))
    side, weight = np.full((4, 3), 50.0), np.array([1.0, 0.5, 1.0])
    whitener = Whitener.of(NOISE, correlation, side, weight, counts)
    assert not whitener.precision[2, 1].any()
    assert not whitener.precision[2, :, 1].any()
    # The others are as if the edge had never been drawn.
    new, repeated = NOISE.edge_variances(np.array([50.0]))
    covariance = repeated * correlation + np.diag(new / weight)
    np.testing.assert_allclose(whitener.precision[0], np.linalg.inv(covariance))
    kept = np.ix_([0, 2], [0, 2])
    np.testing.assert_allclose(whitener.precision[2][kept], np.linalg.inv(covariance[kept]))


def test_the_components_are_the_derivatives_of_the_covariance():
    rng = np.random.default_rng(1)
    correlation = NOISE.correlation(rng.normal(size=(5, 3)))
    side, weight = rng.uniform(20.0, 200.0, size=(4, 5)), rng.uniform(0.1, 1.0, size=5)
    counts = np.ones((4, 5), dtype=bool)
    same_side = np.repeat(side[:, :1], 5, axis=1)
    for sides in (side, same_side):
        whitener = Whitener.of(NOISE, correlation, sides, weight, counts)
        parts = whitener.components(correlation, sides, weight)
        covariance = np.einsum("p,peij->eij", NOISE.variances, parts)
        if sides is same_side:  # sigmas of unequal sides multiply as roots of sums
            np.testing.assert_allclose(np.linalg.inv(covariance), whitener.precision, rtol=1e-8)
        diagonal = np.diagonal(np.linalg.inv(whitener.precision), axis1=1, axis2=2)
        np.testing.assert_allclose(np.diagonal(covariance, axis1=1, axis2=2), diagonal, rtol=1e-8)


def test_a_correction_by_hand():
    """Four squares where two are expected: twice the variance, less what the prior holds back."""
    better = corrected_variances(np.array([1.0]), np.array([400.0]), np.array([200.0]))
    assert better[0] == pytest.approx((400.0 + PRIOR_EDGES) / (200.0 + PRIOR_EDGES))
    nothing = corrected_variances(np.array([2.0]), np.array([0.0]), np.array([0.0]))
    assert nothing[0] == pytest.approx(2.0)


def test_noise_stays_within_limits():
    kept = NOISE.with_variances(np.array([0.0, 0.0, 1e9, 1e9]))
    assert kept.new == BoxNoise(0.1, 1e-4)
    assert kept.repeated == BoxNoise(10.0, 0.15)


def test_variances_of_views_together_by_hand():
    """Four views from one side repeat their error; four from opposite sides do not."""
    side = np.full((4, 4), 100.0)
    new, repeated = (part[0, 0] for part in NOISE.edge_variances(side))
    alike = NOISE.together(np.tile([2.0, 0.0, 0.0], (4, 1)), side)
    np.testing.assert_allclose(alike, new + 4.0 * repeated)
    # The mean of four such independent boxes has the variance that the mean of the four views has.
    assert alike[0, 0] / 4.0 == pytest.approx(new / 4.0 + repeated)
    apart = NOISE.together(np.array([[1.0, 0, 0], [-1.0, 0, 0]]), side[:2])
    shared = np.exp(-np.pi / NOISE.angle)
    np.testing.assert_allclose(apart, new + (1.0 + shared) * repeated)
