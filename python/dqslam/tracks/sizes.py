"""How large a thing is, by its class, before its boxes say more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam.assumptions import SizePrior, SizePriors
from dqslam.assumptions.traffic import usual_sides

# Logarithms of the sides within a class of traffic spread together and each by itself, ...
COMMON_SIGMA, OWN_SIGMA = 0.1, 0.08
# ... and of a class whose proportions are unknown each by itself.
ANY_OWN_SIGMA = 0.4


@dataclass(frozen=True, eq=False)
class BodySize:
    """A normal prior on the logarithms of half the length, width and height."""

    log_half: Floats
    """Middle, log meters, shape (3,)."""
    precision: Floats
    """Inverse of the covariance, shape (3, 3)."""


def body_size(class_name: str, prior: SizePrior | SizePriors | None = None) -> BodySize | None:
    """Return the prior of a class; None where neither a table nor the class tells a size.

    A prior that names the class tells its size, the table of traffic its proportions, too. A size
    for all classes is none of a class.
    """
    sides = usual_sides(class_name)
    common, own = (COMMON_SIGMA, OWN_SIGMA) if sides is not None else (0.0, ANY_OWN_SIGMA)
    log_half = np.zeros(3) if sides is None else np.log(0.5 * sides)
    told = prior.classes.get(class_name) if isinstance(prior, SizePriors) else None
    if told is not None:
        log_half = log_half - log_half.mean() + told.log_mean
        common = told.log_sigma
    elif sides is None:
        return None
    covariance = common**2 * np.ones((3, 3)) + own**2 * np.eye(3)
    return BodySize(np.asarray(log_half), np.asarray(np.linalg.inv(covariance)))
