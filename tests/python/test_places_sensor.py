"""Boxes of low scores err more, by as much as those of the map show."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.places.sensor import _learn_score_slope, assumed_sensor
from small_place import LENS

BOXES = 4000


def errors_by_score(slope, seed=0):
    """Return errors (m, 4) whose variance is exp(slope (0.8 - score)), and scores (m,)."""
    random = np.random.default_rng(seed)
    score = random.uniform(0.5, 0.95, BOXES)
    sigma = np.exp(0.5 * slope * (0.8 - score))
    return random.normal(0.0, 1.0, (BOXES, 4)) * sigma[:, None], score


@pytest.mark.parametrize("slope", [1.5, 3.0])
def test_the_slope_is_that_of_the_errors(slope):
    assert _learn_score_slope(*errors_by_score(slope)) == pytest.approx(slope, abs=0.4)


def test_errors_that_do_not_grow_with_lower_scores_have_no_slope():
    assert _learn_score_slope(*errors_by_score(-2.0)) == 0.0


def test_scores_that_are_alike_tell_nothing():
    error, score = errors_by_score(3.0)
    assert _learn_score_slope(error, 0.9 + 0.05 * score) == 0.0
    assert _learn_score_slope(error, np.ones(BOXES)) == 0.0


def test_the_variance_of_a_box_follows_its_score():
    """By hand: e to the 2 (0.8 - score), and four times at most."""
    usual = assumed_sensor(("cup",), 5.0)
    sensor = replace(usual, noise=dq.BoxNoise(3.0, 0.0), score_slope=2.0, usual_score=0.8)
    box = np.tile([100.0, 100.0, 150.0, 180.0], (4, 1))
    score = np.array([0.8, 0.3, 0.9, 0.0])
    found = sensor.box_covariance(box, score, LENS)
    np.testing.assert_allclose(found[0], 9.0 * np.eye(4))
    np.testing.assert_allclose(found[1], 9.0 * np.e * np.eye(4))
    np.testing.assert_allclose(found[2], 9.0 * np.exp(-0.2) * np.eye(4))
    np.testing.assert_allclose(found[3], 36.0 * np.eye(4))
    without = replace(sensor, score_slope=0.0).box_covariance(box, score, LENS)
    np.testing.assert_allclose(without, np.tile(9.0 * np.eye(4), (4, 1, 1)))
