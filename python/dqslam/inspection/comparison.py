"""Readings of the same files compared by how much of the motion of boxes they explain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.rays import at_depth_one
from dqslam.inspection.windows import (
    LENGTHS,
    Fit,
    Windows,
    fit_points,
    log_shares,
    motions,
    persistence,
)

Floats = NDArray[np.float64]

# A reading explains clearly better if it leaves at most this share of what another one leaves, and
# differs from it by this number of standard deviations over parts of the time.
CLEARLY, SURE = 0.75, 3.5
# Two readings explain equally well if what they leave differs by less than this, or is not sure.
ALIKE, UNSURE = 0.9, 2.5
FEWEST_WINDOWS = 4
# What is left persists from view to view above this value; of noise it is below. A reading that
# leaves what persists less, by this much, may be better still.
PERSISTS, LESS_PERSISTENT = 0.2, 0.1


@dataclass(frozen=True)
class PoseReading:
    """A reading of the poses, in the order in which its parts are applied."""

    w_first: bool = False
    positions: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """Matrix of the true positions from those of the file, row by row."""
    inverted: bool = False
    axes: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    """Axes of the camera in those of the file, a matrix row by row."""


GIVEN = PoseReading()


@dataclass(frozen=True)
class WindowViews:
    """Poses and middles of the views of windows."""

    camera: _core.Camera
    windows: Windows
    poses: Floats  #: (w, n, 7) world_from_camera as read
    middle: Floats  #: (w, n, 2) px as recorded

    @cached_property
    def rays(self) -> Floats:
        """Middles at depth 1 (w, n, 2)."""
        return at_depth_one(self.camera, self.middle)

    @cached_property
    def motion(self) -> Floats:
        """Return the motion of the middles at depth 1, (w,)."""
        return motions(self.rays, self.windows.there)

    @cached_property
    def _turns(self) -> dict[bool, Floats]:
        return {}

    def _turn(self, w_first: bool) -> Floats:
        from scipy.spatial.transform import Rotation

        if w_first not in self._turns:
            quaternion = self.poses[..., [4, 5, 6, 3] if w_first else [3, 4, 5, 6]]
            matrix = Rotation.from_quat(quaternion.reshape(-1, 4)).as_matrix()
            self._turns[w_first] = matrix.reshape(*self.poses.shape[:2], 3, 3)
        return self._turns[w_first]

    def fit(self, reading: PoseReading = GIVEN) -> Fit:
        """Find the points that explain the windows best, with the poses read so."""
        turn = self._turn(reading.w_first)
        position = self.poses[..., :3] @ np.reshape(reading.positions, (3, 3)).T
        if reading.inverted:
            turn = np.swapaxes(turn, -1, -2)
            position = -(turn @ position[..., None])[..., 0]
        turn = turn @ np.reshape(reading.axes, (3, 3))
        return fit_points(turn, position, self.rays, self.windows.there)

    @cached_property
    def given(self) -> Explanation:
        """How much the poses explain as they are."""
        return self.explanation()

    def explanation(self, reading: PoseReading = GIVEN) -> Explanation:
        """Say how much of the motion of the boxes the poses explain, read so."""
        fit = self.fit(reading)
        return Explanation(
            self.windows,
            fit.miss,
            log_shares(fit.miss, self.motion),
            persistence(np.diff(fit.error, axis=1), self.windows),
        )

    @cached_property
    def smoothness(self) -> float:
        """How much the middles of boxes keep their motion from view to view, -1 to 1."""
        return persistence(np.diff(self.rays, axis=1), self.windows)


@dataclass(frozen=True)
class Explanation:
    """How much of the motion of boxes some reading explains."""

    windows: Windows
    miss: Floats  #: (w,) mean distance of middles from their point, at depth 1
    log_share: Floats  #: (w,) logarithm of the share of the motion that is not explained
    persistence: float  #: of what is not explained, -1 to 1; near 0 or below for noise

    @cached_property
    def unexplained(self) -> float:
        """The median share that is not explained, in windows of the length that suits best.

        Short windows suffer from the noise of boxes, long ones from the drift of odometry.
        """
        lengths = range(len(LENGTHS))
        medians = [
            np.exp(np.median(self.log_share[self.windows.length == number]))
            for number in lengths
            if np.sum(self.windows.length == number) >= FEWEST_WINDOWS
        ]
        return float(min(medians, default=np.exp(np.median(self.log_share))))


def difference(windows: Windows, given: Floats, other: Floats) -> tuple[float, float]:
    """Return the mean of ``other - given`` (w,), and how many standard deviations it is from 0.

    Windows of one part of the time share the noise of odometry: parts count as independent.
    """
    change = other - given
    parts = np.unique(windows.part)
    means = np.array([change[windows.part == part].mean() for part in parts])
    if len(means) < 2:
        return float(means.mean()), 0.0
    spread = float(means.std(ddof=1)) / np.sqrt(len(means))
    return float(means.mean()), float(means.mean()) / max(spread, 1e-9)


def clearly_better(given: Explanation, other: Explanation) -> bool:
    """Tell whether the other explanation of the same windows is clearly better.

    What is noise in one, and persists in the other, is not made better by being less.
    """
    change, sigmas = difference(given.windows, given.log_share, other.log_share)
    if other.persistence > max(PERSISTS, given.persistence - LESS_PERSISTENT):
        return False
    return change <= np.log(CLEARLY) and sigmas <= -SURE


def alike(best: Explanation, other: Explanation) -> bool:
    """Tell whether the other explanation of the same windows is hardly worse than the best one."""
    change, sigmas = difference(best.windows, best.log_share, other.log_share)
    return change < -np.log(ALIKE) or sigmas < UNSURE
