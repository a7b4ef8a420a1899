"""How good the odometry is, estimated from how well it agrees with the boxes.

Variance components: the squared residuals of a group of measurements sum to its redundancy, which
is their number less what they determine themselves (Foerstner 1979). Where the sum is larger, the
group is worse than believed, and the estimate is made again with the standard deviation corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association.thinning import compose_covariance
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Recording

# A group must outweigh this many residuals that agree with the level believed: few change little.
PRIOR_RESIDUALS = 1.0
# Meters and radians a step; less is no noise that boxes could show.
MIN_SIGMA = 1e-6


@dataclass(frozen=True)
class StepNoise:
    """Covariance of the motion between keyframes, as a sum of two unknown levels."""

    per_translation: Floats
    """For a sigma of 1 m a step, shape (n - 1, k, k)."""
    per_rotation: Floats
    """For a sigma of 1 rad a step, shape (n - 1, k, k)."""

    @classmethod
    def between(cls, recording: Recording, keyframes: Ints) -> StepNoise:
        """Carry the noise of single steps on to the keyframes."""
        steps, k, _ = recording.odometry.covariance.shape
        translation = np.arange(k) < translation_axes(k)
        units = (
            np.tile(np.diag(part * 1.0), (steps, 1, 1)) for part in (translation, ~translation)
        )
        return cls(*(compose_covariance(recording, unit, keyframes) for unit in units))

    def covariance(self, noise: OdometryNoise) -> Floats:
        """Return the covariances for a level of the noise, shape (n - 1, k, k)."""
        return np.asarray(
            noise.translation_m**2 * self.per_translation
            + noise.rotation_rad**2 * self.per_rotation
        )


def translation_axes(k: int) -> int:
    """Return how many of the k numbers of a tangent are a translation: 2 of 3, or 3 of 6."""
    return k // 2 + k % 2


def corrected(noise: OdometryNoise, fit: _core.Fit) -> OdometryNoise:
    """Return a better level of the noise, from the residuals of an estimate that believed one."""
    k = fit.odometry_residuals.shape[1]
    better = []
    for value, part in (
        (noise.translation_m, slice(0, translation_axes(k))),
        (noise.rotation_rad, slice(translation_axes(k), k)),
    ):
        squares = np.sum(fit.odometry_residuals[:, part] ** 2)
        redundancy = np.sum(1.0 - fit.odometry_leverage[:, part])
        factor = np.sqrt((squares + PRIOR_RESIDUALS) / (redundancy + PRIOR_RESIDUALS))
        better.append(max(value * float(factor), MIN_SIGMA))
    return OdometryNoise(*better)
