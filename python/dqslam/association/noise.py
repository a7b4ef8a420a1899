"""How good the odometry is, estimated from how well it agrees with the boxes.

The covariance of a step is a sum of components: of each a shape is known, and a level is not.
Variance components: the squared residuals of a group of measurements sum to its redundancy, which
is their number less what they determine themselves (Foerstner 1979). Each residual counts for a
component by the share of its variance that the component has. Where the sum of squares is larger
than the redundancy, the component is larger than believed, and the estimate is made again with its
level corrected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Recording
from dqslam.recording.odometry import compose_covariance

# A kind must outweigh this many residuals that agree with the level believed: few change little.
PRIOR_RESIDUALS = 1.0
# Logarithms of the variances of axes differ by this, or by much: odometry on the plane has no noise
# out of it. Hence a Cauchy distribution of this scale.
SPREAD_OF_AXES = 0.3
# A correction changes variances by this factor at most.
MAX_RATIO = 100.0
# A step that takes so many times the usual interval is over a gap, and as uncertain as all of them.
MIN_GAP = 3.0
# A step is a jump if noise would be as far off once in a million steps. By residuals, 0 to 6.
JUMP_CHI2 = np.array([np.inf, 23.93, 27.63, 30.66, 33.38, 35.89, 38.26])
# Boxes say something of a residual of the odometry if its redundancy is above this.
MIN_REDUNDANCY = 0.05
# Times that jumps are looked for: without the largest, the level is lower, and others stand out.
JUMP_ROUNDS = 3

# The motion of a step is the median of so many, it in the middle.
MEDIAN_STEPS = 5

OF_MOTION = ("length", "angle")


@dataclass(frozen=True)
class StepNoise:
    """Covariance of the motion between keyframes, as a sum of c components of unknown levels."""

    names: tuple[str, ...]
    """Of the components."""
    units: Floats
    """Covariance of each motion for a level of 1, shape (c, n - 1, k, k)."""
    of_step: Floats
    """Mean variance of a step along an axis and about one, for a level of 1, shape (c, 2)."""
    finds_jumps: bool = True
    """Whether a step may have a covariance of its own."""

    @classmethod
    def isotropic(cls, per_translation: Floats, per_rotation: Floats) -> StepNoise:
        """Have a level of translation and one of rotation, for sigmas of 1 m and 1 rad a step.

        Shapes (n - 1, k, k).
        """
        units = np.stack([per_translation, per_rotation])
        return cls(("translation", "rotation"), units, np.eye(2), finds_jumps=False)

    @classmethod
    def between(cls, recording: Recording, keyframes: Ints) -> StepNoise:
        """Take the components of single steps, and carry them on to the keyframes.

        Levels are a sigma for each axis, meters and radians a step, or, across a gap in time, an
        usual interval; and the share of its length and of its angle by which a step is off.
        """
        moved, turned = _motions(recording)
        steps, k, _ = recording.odometry.covariance.shape
        t = translation_axes(k)
        axes = np.einsum("ca,cb->cab", np.eye(k), np.eye(k))
        of_motion = np.zeros((2, steps, k))
        of_motion[0, :, :t], of_motion[1, :, t:] = moved, turned
        single = np.concatenate(
            [
                usual_intervals(recording.timestamps)[:, None, None] * axes[:, None],
                np.einsum("csa,csb->csab", of_motion, of_motion),
            ]
        )
        variance = np.einsum("csaa->ca", single) / max(steps, 1)
        return cls(
            (
                *(f"translation_{axis}" for axis in "xyz"[:t]),
                *(f"rotation_{axis}" for axis in "xyz"[t - k :]),
                *OF_MOTION,
            ),
            np.stack([compose_covariance(recording.odometry, unit, keyframes) for unit in single]),
            np.column_stack([variance[:, :t].mean(axis=1), variance[:, t:].mean(axis=1)]),
        )

    @property
    def is_rotation(self) -> Bools:
        """Which components are rotations, shape (c,)."""
        return np.array([name.startswith(("rotation", "angle")) for name in self.names])

    @property
    def kinds(self) -> Ints:
        """Numbers of kinds, the same for all axes of translation or of rotation, shape (c,)."""
        return np.where(np.isin(self.names, OF_MOTION), 2, 0) + self.is_rotation

    def covariance(self, levels: Floats, inflation: Floats | None = None) -> Floats:
        """Return the covariances for some levels (c,), shape (n - 1, k, k).

        Those of jumps are multiplied by their ``inflation``, shape (n - 1,).
        """
        covariance = np.einsum("c,csab->sab", levels**2, self.units)
        return np.asarray(
            covariance if inflation is None else inflation[:, None, None] * covariance
        )

    def typical(self, levels: Floats) -> OdometryNoise:
        """Return the root mean square of a step on an axis, for some levels (c,)."""
        return OdometryNoise(*np.sqrt(levels**2 @ self.of_step).tolist())


def _motions(recording: Recording) -> tuple[Floats, Floats]:
    """Return how each step moves, (s, t), and turns, (s, r), in the frame of its end.

    The median of the steps around it: the noise of a step, which is in what it measured, is no
    motion, and would explain itself as a share of it.
    """
    from scipy.ndimage import median_filter
    from scipy.spatial.transform import Rotation

    odometry = recording.odometry
    moved = -_core.inverse(odometry.pose_model, odometry.relative)[:, :3]
    if odometry.pose_model == _core.PoseModel.SE2:
        moved, turned = moved[:, :2], odometry.relative[:, 2:]
    else:
        turned = Rotation.from_quat(odometry.relative[:, 3:].copy()).as_rotvec()
    if not len(moved):
        return moved, turned
    around = (MEDIAN_STEPS, 1)
    return median_filter(moved, around, mode="nearest"), median_filter(
        turned, around, mode="nearest"
    )


def usual_intervals(timestamps: Floats) -> Floats:
    """Return how many median intervals each step takes, 1 unless it is over a gap, shape (s,)."""
    interval = np.diff(timestamps)
    if not interval.size:
        return np.ones(0)
    ratio = interval / np.median(interval)
    return np.where(ratio >= MIN_GAP, ratio, 1.0)


def translation_axes(k: int) -> int:
    """Return how many of the k numbers of a tangent are a translation: 2 of 3, or 3 of 6."""
    return k // 2 + k % 2


class OdometryFit(Protocol):
    """How well the motions between keyframes fit an estimate."""

    @property
    def odometry_residuals(self) -> Floats:
        """In sigmas, by the inverse of the covariance's Cholesky factor, shape (s, k)."""

    @property
    def odometry_leverage(self) -> Floats:
        """From 0 to 1, shape (s, k)."""


@dataclass(frozen=True)
class Correction:
    """Better levels of the noise, and how far they are from those that were believed."""

    levels: Floats
    """Shape (c,)."""
    inflation: Floats
    """Factor of the covariance of each motion, 1 unless it is a jump, shape (n - 1,)."""
    change: float
    """Mean logarithm of the factor of sigmas, over all that the boxes say something of."""


def corrected(
    noise: StepNoise, levels: Floats, inflation: Floats, fit: OdometryFit, *, lowest: Floats
) -> Correction:
    """Return better levels from the residuals of an estimate that believed some.

    It may end before the last keyframe. No level falls below its ``lowest``, shape (c,).
    """
    steps = len(fit.odometry_residuals)
    # Rows of the whitener are directions: the variance that a component has in each, as a share.
    whitener = np.linalg.inv(np.linalg.cholesky(noise.covariance(levels, inflation)[:steps]))
    units = noise.units[:, :steps]
    share = np.einsum("c,sia,csab,sib->csi", levels**2, whitener, units, whitener, optimize=True)
    squares = np.asarray(fit.odometry_residuals**2)
    redundancy = 1.0 - np.clip(fit.odometry_leverage, 0.0, 1.0)

    factors = np.ones(len(levels))
    is_jump = np.zeros(steps, dtype=np.bool_)
    for _ in range(JUMP_ROUNDS):
        found = np.einsum("csi,si->c", share[:, ~is_jump], squares[~is_jump])
        expected = np.einsum("csi,si->c", share[:, ~is_jump], redundancy[~is_jump])
        factors = better_variances(levels**2, found, expected, noise.kinds) / levels**2
        if not noise.finds_jumps:
            break
        variance = np.einsum("c,csi->si", factors, share)
        impossible = is_impossible(variance, squares, redundancy)
        if not (impossible & ~is_jump).any():
            break
        is_jump |= impossible

    now = inflation.copy()
    now[:steps] = 1.0
    variance = np.einsum("c,csi->si", factors, share)
    for step in np.flatnonzero(is_jump).tolist():
        now[step] = jump_inflation(variance[step], squares[step], redundancy[step])
    change = np.abs(np.log(variance * now[:steps, None])) / 2.0
    known = max(float(redundancy.sum()), 1e-12)
    return Correction(
        np.maximum(levels * np.sqrt(factors), lowest),
        now,
        float(np.sum(redundancy * change)) / known,
    )


def better_variances(variance: Floats, found: Floats, expected: Floats, kinds: Ints) -> Floats:
    """Return better variances of the components, (c,), than those that were believed.

    Parameters
    ----------
    variance
        What was believed, shape (c,).
    found, expected
        Sums of squared residuals and of redundancies, by the share of each component, (c,).
    kinds
        What little is seen of a component is taken to be as the others of its kind, shape (c,).
    """
    same = (kinds[:, None] == kinds).astype(float)
    usual = (same @ (variance * found) + PRIOR_RESIDUALS * variance) / (
        same @ expected + PRIOR_RESIDUALS
    )
    # Of the distribution of logarithms, the normal one with the same slope where we are.
    off = np.log(variance / usual)
    weight = 1.0 / (SPREAD_OF_AXES**2 + off**2)
    low = np.full(len(off), -np.log(MAX_RATIO))
    high = -low
    while np.any(high - low > 1e-6):  # the slope of the posterior falls: bisection finds its zero
        middle = 0.5 * (low + high)
        slope = 0.5 * (found * np.exp(-middle) - expected) - weight * (off + middle)
        low, high = np.where(slope > 0.0, middle, low), np.where(slope > 0.0, high, middle)
    alone = same.sum(axis=1) == 1.0
    return np.asarray(np.where(alone, usual, variance * np.exp(0.5 * (low + high))))


def is_impossible(variance: Floats, squares: Floats, redundancy: Floats) -> Bools:
    """Return which steps noise does not explain, shape (s,).

    Of whitened residuals: their variances in units of what was believed, their squares, and their
    redundancies, shape (s, k). A residual over its redundancy is an error of the step as boxes
    measure it, with the variance of the step and, beside it, leverage over redundancy.
    """
    known = redundancy > MIN_REDUNDANCY
    spread = redundancy * (variance * redundancy + 1.0 - redundancy)
    chi2 = np.where(known, squares / np.where(known, spread, 1.0), 0.0).sum(axis=1)
    return np.asarray(chi2 > JUMP_CHI2[known.sum(axis=1)])


def jump_inflation(variance: Floats, squares: Floats, redundancy: Floats) -> float:
    """Return the factor of a step's variances, shape (k,), for which its residuals are usual."""
    known = redundancy > MIN_REDUNDANCY
    variance, squares, redundancy = variance[known], squares[known], redundancy[known]
    factor = 1.0
    for _ in range(50):
        total = factor * variance * redundancy + 1.0 - redundancy
        found = np.sum(variance * squares / total**2)
        factor *= float(found / np.sum(variance * redundancy / total))
    return max(factor, 1.0)
