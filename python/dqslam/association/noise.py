"""How good the odometry is, estimated from how well it agrees with the boxes.

The covariance of a step is a sum of components: a shape, known from the step, times the square of a
level that is not. Residuals r of an estimate, whitened by what was believed, and their leverages h
are those of an independent measurement of the error of each step, r / (1 - h), with variance
h / (1 - h) beside that of the step. The levels of greatest likelihood have the sum of squares that
is expected, of all residuals, each with the share of its variance that a component has: variance
components (Foerstner 1979; restricted maximum likelihood). Then the estimate is made again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.association.thinning import compose_covariance
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Recording

import os
# A component must outweigh this many residuals that agree with its kind.
PRIOR_RESIDUALS = float(os.environ.get("PR","1"))
# Variances change by this factor at most: residuals far from what was believed tell little of it.
SPREAD_OF_KIND=float(os.environ.get("PK","0.3"))
MAX_RATIO = 100.0
# Variances change by this factor at most from one iteration of the likelihood to the next.
MAX_STEP = 100.0
# Iterations of the likelihood for fixed residuals: a level that rises or falls needs a few.

# A step over a gap in time, so many times the usual interval, is as uncertain as the intervals in it.
MIN_GAP = 3.0
# A jump: noise would be so far off once in a million steps. By degrees of freedom, 0 to 6.
JUMP_CHI2 = np.array([np.inf, 23.93, 27.63, 30.66, 33.38, 35.89, 38.26])


@dataclass(frozen=True)
class StepNoise:
    """Covariance of the motion between keyframes, as a sum of unknown levels."""

    names: tuple[str, ...]
    """Of the components, c of them."""
    units: Floats
    """Covariance of each motion for a level of 1, shape (c, n - 1, k, k)."""
    of_step: Floats
    """Mean variance of a step along an axis and about one, for a level of 1, shape (c, 2)."""

    @classmethod
    def isotropic(cls, per_translation: Floats, per_rotation: Floats) -> StepNoise:
        """Have one level of translation and one of rotation, (n - 1, k, k), of 1 m and 1 rad."""
        units = np.stack([per_translation, per_rotation])
        return cls(("translation", "rotation"), units, np.eye(2))

    @classmethod
    def between(cls, recording: Recording, keyframes: Ints) -> StepNoise:
        """Take the components of single steps, and carry them on to the keyframes.

        A level for each axis, [m] and [rad] a step or, across a gap, a usual interval, and one of
        the length and of the angle that a step moves, as a share of them.
        """
        translations, rotation = motions(recording)
        steps, k, _ = recording.odometry.covariance.shape
        t = translation_axes(k)
        gap = gaps(recording.timestamps)
        axes = gap[:, None, None] * np.einsum("ca,cb->cab", np.eye(k), np.eye(k))[:, None]
        moved = np.zeros((2, steps, k))
        moved[0, :, :t], moved[1, :, t:] = translations, rotation
        single = np.concatenate([axes, np.einsum("csa,csb->csab", moved, moved)])
        names = [f"translation_{axis}" for axis in "xyz"[:t]]
        names += [f"rotation_{axis}" for axis in "xyz"[3 - (k - t) :]]
        variance = np.einsum("csaa->ca", single) / max(steps, 1)
        return cls(
            (*names, "length", "angle"),
            np.stack([compose_covariance(recording, unit, keyframes) for unit in single]),
            np.column_stack([variance[:, :t].mean(axis=1), variance[:, t:].mean(axis=1)]),
        )

    @property
    def kind(self) -> Ints:
        """Components of the same kind have the same number, shape (c,)."""
        single = np.isin(self.names, ["length", "angle"])
        return np.where(single, 2 + np.arange(len(self.names)), self.is_rotation)

    @property
    def is_rotation(self) -> Bools:
        """Which components are rotations, shape (c,)."""
        return np.asarray(self.of_step[:, 1] > self.of_step[:, 0])

    def covariance(self, levels: Floats, inflation: Floats | float = 1.0) -> Floats:
        """Return the covariances for some levels (c,), shape (n - 1, k, k).

        That of a jump is inflated, shape (n - 1,).
        """
        sum_of_all = np.einsum("c,csab->sab", levels**2, self.units)
        return np.asarray(np.broadcast_to(inflation, len(sum_of_all))[:, None, None] * sum_of_all)

    def typical(self, levels: Floats) -> OdometryNoise:
        """Return the root mean square of a step for some levels (c,)."""
        return OdometryNoise(*np.sqrt(levels**2 @ self.of_step).tolist())


def motions(recording: Recording) -> tuple[Floats, Floats]:
    """Return how each step moves, (s, t), and turns, (s, r), in the frame of its end."""
    relative = recording.odometry.relative
    back = _core.inverse(recording.odometry.pose_model, relative)
    if recording.odometry.pose_model == _core.PoseModel.SE2:
        return -back[:, :2], relative[:, 2:]
    return -back[:, :3], Rotation.from_quat(relative[:, 3:]).as_rotvec()


def gaps(timestamps: Floats) -> Floats:
    """Return how many usual intervals each step takes, 1 unless there is a gap, shape (s,)."""
    interval = np.diff(timestamps)
    if not interval.size or np.median(interval) <= 0.0:
        return np.ones(len(interval))
    ratio = interval / np.median(interval)
    return np.where(ratio > MIN_GAP, ratio, 1.0)


def translation_axes(k: int) -> int:
    """Return how many of the k numbers of a tangent are a translation: 2 of 3, or 3 of 6."""
    return k // 2 + k % 2


@dataclass(frozen=True)
class Correction:
    """Better levels of the noise, and how far that is from what was believed."""

    levels: Floats
    inflation: Floats
    change: float
    """Mean logarithm of the factor of sigma, over all that residuals say something of."""


def corrected(
    noise: StepNoise, levels: Floats, inflation: Floats, fit: _core.Fit, *, lowest: Floats
) -> Correction:
    """Return better levels from the residuals of an estimate that believed some.

    It had the motions up to its last pose, the first of them. No level becomes lower than its
    ``lowest``, shape (c,).
    """
    steps = len(fit.odometry_residuals)
    believed = noise.covariance(levels, inflation)[:steps]
    whitener = np.linalg.inv(np.linalg.cholesky(believed))
    part = np.einsum("sia,csab,sib->csi", whitener, noise.units[:, :steps], whitener)
    part *= (levels**2)[:, None, None]  # of the variance of each residual, if nothing changes
    squares = fit.odometry_residuals**2
    leverage = np.clip(fit.odometry_leverage, 0.0, 1.0)
    redundancy = 1.0 - leverage
    counted = redundancy.sum(axis=1) > 0.0

    factors = np.ones(len(levels))
    jumps = np.zeros(steps, dtype=np.bool_)
    for _ in range(3):
        used = counted & ~jumps
        better = _most_likely(
            part[:, used], squares[used], redundancy[used], levels**2, noise.kind
        )
        factors = better / levels**2
        variance = np.einsum("c,csi->si", factors, part)
        found = ~jumps & _is_jump(variance, squares, redundancy, leverage)
        if not found.any():
            break
        jumps |= found
    now = inflation.copy()
    now[:steps] = 1.0
    for step in np.flatnonzero(jumps):
        now[step] = _inflate(variance[step], squares[step], redundancy[step], leverage[step])
    ratio = np.einsum("c,csi->si", factors, part) * now[:steps, None]
    change = np.sum(redundancy * np.abs(np.log(ratio))) / (2.0 * max(redundancy.sum(), 1e-9))
    return Correction(np.maximum(levels * np.sqrt(factors), lowest), now, float(change))


def _most_likely(
    part: Floats, squares: Floats, redundancy: Floats, variance: Floats, kind: Ints
) -> Floats:
    """Return better variances of the components, (c,), from those that were believed.

    What little is seen of a component is taken to be as the others of its ``kind``, shape (c,).
    """
    found = variance * np.einsum("csi,si->c", part, squares)
    expected = np.einsum("csi,si->c", part, redundancy)
    same = kind[:, None] == kind
    usual = (same @ found + PRIOR_RESIDUALS * variance) / (same @ expected + PRIOR_RESIDUALS)
    # The prior is a Cauchy distribution of the logarithm: here as the normal one that has the same
    # slope where we are.
    off = np.log(variance / usual)
    weight = 1.0 / (SPREAD_OF_KIND**2 + off**2)
    low, high = np.full(len(off), -np.log(MAX_RATIO)), np.full(len(off), np.log(MAX_RATIO))
    for _ in range(40):
        middle = 0.5 * (low + high)
        rises = 0.5 * (found / variance * np.exp(-middle) - expected) > weight * (off + middle)
        low, high = np.where(rises, middle, low), np.where(rises, high, middle)
    return variance * np.exp(middle)


def _is_jump(variance: Floats, squares: Floats, redundancy: Floats, leverage: Floats) -> Bools:
    shown = redundancy > 0.05
    chi2 = squares / np.maximum(redundancy * (variance * redundancy + leverage), 1e-300)
    return np.asarray(np.sum(np.where(shown, chi2, 0.0), axis=1) > JUMP_CHI2[shown.sum(axis=1)])


def _inflate(variance: Floats, squares: Floats, redundancy: Floats, leverage: Floats) -> float:
    """Return the factor of a step's variance for which its residuals are what is expected."""
    factor = 1.0
    shown = redundancy > 0.05
    v, s, q, h = (a[shown] for a in (variance, squares, redundancy, leverage))
    for _ in range(100):
        total = factor * v * q + h
        factor *= float(np.sum(v * s / total**2) / np.sum(v * q / total))
    return max(factor, 1.0)
