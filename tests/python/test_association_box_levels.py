import numpy as np
import pytest

from dqslam.association.box_levels import MAX_RATIO, MIN_PIXELS, PRIOR_RESIDUALS, corrected_boxes
from dqslam.assumptions import BoxNoise


def test_a_correction_by_hand():
    """Believed variances 3^2 + (0.1 40)^2 = 25: shares 9 / 25 and 16 / 25, whatever the edge."""
    error, side = np.array([5.0, 10.0, -5.0, 0.0]), np.full(4, 40.0)  # squares 1, 4, 1, 0 over 25
    found = corrected_boxes(BoxNoise(3.0, 0.1), error, side, 0.5)
    ratios = [
        (share * 6 + PRIOR_RESIDUALS) / (share * 4 * 0.5 + PRIOR_RESIDUALS)
        for share in (9 / 25, 16 / 25)
    ]
    assert found.pixels == pytest.approx(3.0 * np.sqrt(ratios[0]))
    assert found.relative == pytest.approx(0.1 * np.sqrt(ratios[1]))


@pytest.mark.parametrize("true", [BoxNoise(1.0, 0.0), BoxNoise(3.0, 0.1), BoxNoise(0.5, 0.02)])
def test_both_parts_are_recovered(true):
    random = np.random.default_rng(1)
    side = random.uniform(20, 400, 4000)
    error = np.hypot(true.pixels, true.relative * side) * random.normal(size=len(side))
    noise = BoxNoise()
    for _ in range(200):
        noise = corrected_boxes(noise, error, side, 1.0)
    assert noise.relative == pytest.approx(true.relative, abs=0.003)
    # Of small boxes there are few, and a part that hardly shows comes down or up slowly.
    for width, tolerance in ((20.0, 0.2), (50.0, 0.1), (100.0, 0.05), (400.0, 0.05)):
        found = np.hypot(noise.pixels, noise.relative * width)
        assert found == pytest.approx(np.hypot(true.pixels, true.relative * width), rel=tolerance)


def test_a_correction_is_bounded():
    perfect = corrected_boxes(BoxNoise(2.0, 0.05), np.zeros(4000), np.full(4000, 50.0), 1.0)
    assert perfect == BoxNoise(2.0 / MAX_RATIO, 0.05 / MAX_RATIO)
    far = corrected_boxes(BoxNoise(2.0, 0.05), np.full(4000, 1e3), np.full(4000, 50.0), 1.0)
    assert far == BoxNoise(2.0 * MAX_RATIO, 0.05 * MAX_RATIO)
    least = corrected_boxes(BoxNoise(MIN_PIXELS, 0.0), np.zeros(4000), np.full(4000, 50.0), 1.0)
    assert least.pixels == MIN_PIXELS
    # No boxes at all: what was believed.
    none = np.zeros(0)
    assert corrected_boxes(BoxNoise(2.0, 0.05), none, none, 1.0) == BoxNoise(2.0, 0.05)
