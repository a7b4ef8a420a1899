"""The errors of the edges of boxes."""

import numpy as np
from numpy.random import Generator

from dqslam._checks import Floats
from dqslam.simulation.scenario import DetectorSettings

_OUTWARDS = np.array([-1.0, -1.0, 1.0, 1.0])


def disturb_edges(
    box: Floats, settings: DetectorSettings, random: Generator, for_tails: Generator
) -> Floats:
    """Add noise and bias to exact boxes (n, o, 4), and round them.

    A Student t is a Gaussian divided by a random scale, so that tails only stretch the errors.
    """
    noise = random.normal(0.0, settings.edge_sigma_px, size=box.shape)
    dof = settings.edge_tail_dof
    if dof is not None:
        noise /= np.sqrt(for_tails.chisquare(dof, size=box.shape) / dof)
    measured = box + noise
    if settings.edge_bias_px != 0.0:
        measured = measured + settings.edge_bias_px * _OUTWARDS
    if settings.whole_pixels:
        measured = np.round(measured + 0.5) - 0.5  # the corner of the image is at -0.5
    return np.asarray(measured)
