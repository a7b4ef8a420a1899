"""How far the edges of boxes are off, estimated from how well they agree with each other.

Variance components again: a part that is the same for all edges, and one that grows with the box.
"""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.assumptions import BoxNoise

# What was believed weighs as much as this many residuals of either part.
PRIOR_RESIDUALS = 10.0
# Sigmas change by this factor at most: residuals far from what was believed tell little of it.
MAX_RATIO = 2.0
# Edges are drawn to pixels: less is no noise of a detector.
MIN_PIXELS = 0.1
# Errors of a detector repeat from image to image of a video. They look smaller than they are, and
# noise that is estimated from boxes behind a gate may only fall: it is never below the default.
LEAST = BoxNoise()
# With more noise, any boxes fit any objects.
MOST = BoxNoise(pixels=10.0, relative=0.15)


def within_limits(noise: BoxNoise) -> BoxNoise:
    """Return the noise, not below the default and not so large that it explains everything."""
    return BoxNoise(
        float(np.clip(noise.pixels, LEAST.pixels, MOST.pixels)),
        float(np.clip(noise.relative, LEAST.relative, MOST.relative)),
    )


def corrected_boxes(noise: BoxNoise, error: Floats, side: Floats, redundancy: float) -> BoxNoise:
    """Return a better noise from the residuals of an estimate that believed one.

    Parameters
    ----------
    error, side
        Of each edge, pixels, shape (e,): how far it is from the outline, and the side across it.
    redundancy
        Mean of 1 - leverage over the edges.
    """
    constant = noise.pixels**2
    variance = constant + (noise.relative * side) ** 2
    squares = error**2 / variance
    ratios = []
    for share in (constant / variance, 1.0 - constant / variance):
        found = np.sum(share * squares) + PRIOR_RESIDUALS
        ratios.append(found / (redundancy * np.sum(share) + PRIOR_RESIDUALS))
    pixels, relative = np.clip(np.sqrt(ratios), 1.0 / MAX_RATIO, MAX_RATIO)
    return BoxNoise(float(max(noise.pixels * pixels, MIN_PIXELS)), float(noise.relative * relative))
