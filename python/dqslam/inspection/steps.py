"""Steps between successive images: how boxes move, beside how the odometry says the camera did.

In one step all boxes share the error of the odometry, three parts of rotation and three of
translation, and each box has noise of its own. The inverse distance of an object is unknown, but it
is the same along some steps, which carry it on. All of that is Gaussian, with three levels that are
estimated: of rotation, of translation, and of boxes. Where odometry is noisy, the noise of each
step is its own, and the sum over steps sees what no window along the noisy path shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Views of an object in successive images that share one inverse distance.
FEWEST_VIEWS, MOST_VIEWS = 3, 40
SWEEPS = 4  #: of inverse distances, then errors of steps and levels
LEVEL_SWEEPS = 4
NEARER = 0.5  #: an object is at least this many times as far as a step is long
FAR = 5.0  #: a step of a box that is so many times as far off as usual does not count
AHEAD = 0.1  #: least share of its depth that a step leaves an object
DEGREES = 4.0  #: of freedom of a step: errors have heavy tails
# Levels to begin with, and the least: rotation [rad], translation [steps], boxes at depth 1. Where
# steps have a single box, nothing else keeps the level of boxes from zero.
FIRST_LEVELS, LEAST_LEVELS = (1e-2, 3e-2, 3e-3), (1e-6, 1e-6, 5e-4)


@dataclass(frozen=True)
class BoxSteps:
    """Runs of an object's boxes in successive images, s of at most n views."""

    image: Ints  #: (s, n) place of the image in time
    ray: Floats  #: (s, n, 2) middles at depth 1
    there: Bools  #: (s, n - 1) whether it is a step
    used: Bools  #: (s, n - 1) whether that step counts
    images: int  #: number of all images

    @cached_property
    def step(self) -> Ints:
        """Step of the camera, from image i to i + 1, of each step of a box, (s, n - 1)."""
        return np.where(self.there, self.image[:, :-1], 0)

    @cached_property
    def seen(self) -> Bools:
        """Whether a step of the camera has boxes, (images - 1,)."""
        seen = np.zeros(self.images - 1, dtype=bool)
        seen[self.step[self.used]] = True
        return seen


def find_steps(tracks: list[Ints], image: Ints, ray: Floats) -> BoxSteps:
    """Cut tracks into runs of successive images.

    Parameters
    ----------
    tracks
        Rows of the boxes of each object, in order of time.
    image
        Place of the image of each box in time, (m,).
    ray
        Middles of all boxes at depth 1, (m, 2).
    """
    runs: list[Ints] = []
    for track in tracks:
        for run in np.split(track, np.flatnonzero(np.diff(image[track]) != 1) + 1):
            parts = max(1, -(-(len(run) - 1) // (MOST_VIEWS - 1)))
            bounds = np.linspace(0, len(run) - 1, parts + 1).round().astype(int)
            pieces = (run[a : b + 1] for a, b in zip(bounds[:-1], bounds[1:], strict=True))
            runs += [piece for piece in pieces if len(piece) >= FEWEST_VIEWS]
    if not runs:
        none = np.zeros((0, 2), dtype=np.int64)
        nothing = none[:, 1:].astype(bool)
        return BoxSteps(none, np.zeros((0, 2, 2)), nothing, nothing, 1)
    most = max(map(len, runs))
    rows = np.array([np.pad(run, (0, most - len(run)), "edge") for run in runs])
    there = np.array([np.arange(1, most) < len(run) for run in runs])
    return BoxSteps(image[rows], ray[rows], there, there, int(image.max()) + 1)


def without_outliers(steps: BoxSteps, turn: Floats, shift: Floats) -> BoxSteps:
    """Return steps of which those do not count that are far from what all others say.

    A track that goes over to another object makes such a step, and so does a false box.
    """
    fit = fit_steps(steps, turn, shift)
    off = np.sum(fit.left**2, axis=2)
    usual = float(np.median(off[steps.used])) if steps.used.any() else 0.0
    return replace(steps, used=steps.used & (off <= FAR**2 * usual))


@dataclass(frozen=True)
class StepFit:
    """How well steps of the odometry explain those of boxes."""

    cost: Floats  #: (m,) -2 log likelihood of each step of the camera, robust; 0 without boxes
    levels: Floats  #: (3,) standard deviations: rotation, translation, boxes
    inverse: Floats  #: (s,) inverse distance of the first view of each run, in steps
    left: Floats  #: (s, n - 1, 2) what is left of each step of a box


def fit_steps(steps: BoxSteps, turn: Floats, shift: Floats, like: StepFit | None = None) -> StepFit:
    """Find the inverse distances of objects and the errors of steps that explain boxes best.

    Parameters
    ----------
    steps
        Runs of boxes.
    turn, shift
        Of each step of the camera: the rotation first_from_second, (m, 3, 3), and the position of
        the second camera in the first, (m, 3).
    like
        A fit to begin with, whose levels are kept; by default they are estimated.
    """
    length = np.linalg.norm(shift, axis=1)
    unit = float(np.median(length[length > 0])) if (length > 0).any() else 1.0
    shift = shift / unit
    nearest = 1.0 / (NEARER * max(1.0, float(np.quantile(length, 0.9)) / unit))
    inverse = np.zeros(len(steps.ray)) if like is None else np.minimum(like.inverse, nearest)
    levels = np.array(FIRST_LEVELS) if like is None else like.levels
    error = np.zeros((len(turn), 6))
    for _ in range(SWEEPS if like is None else 1):
        inverse = _distances(steps, turn, shift, inverse, error, nearest)
        sums = _sums(steps, turn, shift, inverse)
        for _ in range(LEVEL_SWEEPS if like is None else 1):
            error, spread = sums.errors(levels)
            levels = sums.levels(error, spread) if like is None else levels
    place, near, _ = _predicted(steps, turn, shift, inverse)
    left = steps.ray[:, 1:] - place - _moved(place, near, error[steps.step])
    return StepFit(sums.costs(levels), levels, inverse, left)


def _predicted(
    steps: BoxSteps, turn: Floats, shift: Floats, inverse: Floats
) -> tuple[Floats, Floats, Bools]:
    """Return where boxes go by the odometry, (s, n - 1, 2), and their inverse distances there.

    ``inverse`` (s,) is that of the first view; each step changes it. The last array tells which
    steps are, and end ahead of the camera.
    """
    views = steps.ray.shape[1]
    place = np.zeros((len(steps.ray), views - 1, 2))
    near, good = np.zeros(place.shape[:2]), steps.there.copy()
    ones = np.ones((len(steps.ray), 1))
    for i in range(views - 1):
        step = steps.step[:, i]
        before = np.hstack([steps.ray[:, i], ones]) - inverse[:, None] * shift[step]
        after = (before[:, None] @ turn[step])[:, 0]
        good[:, i] &= after[:, 2] > AHEAD
        depth = np.where(good[:, i], after[:, 2], 1.0)
        place[:, i] = after[:, :2] / depth[:, None]
        inverse = inverse / depth
        near[:, i] = inverse
    return place, near, good & steps.used


def _by_errors(place: Floats, near: Floats) -> Floats:
    """Return the derivative of places by errors of rotation and translation, (..., 2, 6)."""
    x, y = place[..., 0], place[..., 1]
    zero = np.zeros_like(x)
    return np.stack(
        [
            np.stack([x * y, -(1 + x * x), y, -near, zero, near * x], axis=-1),
            np.stack([1 + y * y, -x * y, -x, zero, -near, near * y], axis=-1),
        ],
        axis=-2,
    )


def _moved(place: Floats, near: Floats, error: Floats) -> Floats:
    """Return how far errors of steps (..., 6) move boxes."""
    return np.asarray((_by_errors(place, near) @ error[..., None])[..., 0])


def _distances(
    steps: BoxSteps, turn: Floats, shift: Floats, inverse: Floats, error: Floats, nearest: float
) -> Floats:
    """Return better inverse distances of the first views, (s,): one step of Gauss and Newton."""
    place, near, good = _predicted(steps, turn, shift, inverse)
    small = 1e-4 * nearest
    moved, _, still = _predicted(steps, turn, shift, inverse + small)
    left = steps.ray[:, 1:] - place
    left -= _moved(place, near, error[steps.step])
    slope = np.where((good & still)[..., None], (moved - place) / small, 0.0)
    curvature = np.maximum(np.sum(slope**2, axis=(1, 2)), 1e-12)
    change = np.sum(slope * left, axis=(1, 2)) / curvature
    return np.asarray(np.clip(inverse + change, 0.0, nearest))


@dataclass(frozen=True)
class _Sums:
    """Sums over the boxes of each step of the camera: of what is left, and its derivatives."""

    number: Floats  #: (m,)
    squares: Floats  #: (m,)
    gradient: Floats  #: (m, 6)
    normal: Floats  #: (m, 6, 6)

    def errors(self, levels: Floats) -> tuple[Floats, Floats]:
        """Return the likeliest error of each step (m, 6), and its covariance (m, 6, 6)."""
        prior = np.diag((levels[2] / np.repeat(levels[:2], 3)) ** 2)
        spread = np.linalg.inv(self.normal + prior)
        return (spread @ self.gradient[..., None])[..., 0], spread * levels[2] ** 2

    def levels(self, error: Floats, spread: Floats) -> Floats:
        """Return levels of noise (3,) that are likelier: a step of expectation-maximization."""
        seen = self.number > 0
        second = (error**2 + np.diagonal(spread, axis1=1, axis2=2))[seen]
        left = self.squares - 2 * np.sum(error * self.gradient, axis=1)
        left += (error[:, None] @ self.normal @ error[..., None])[:, 0, 0]
        left += np.einsum("mij,mji->m", self.normal, spread)
        box = max(0.0, np.sum(left[seen])) / (2 * np.sum(self.number))
        variances = [np.mean(second[:, :3]), np.mean(second[:, 3:]), box]
        return np.asarray(np.maximum(np.sqrt(variances), LEAST_LEVELS), dtype=float)

    def costs(self, levels: Floats) -> Floats:
        """Return -2 log likelihood of each step (m,), but for a constant."""
        error, _ = self.errors(levels)
        chi2 = (self.squares - np.sum(error * self.gradient, axis=1)) / levels[2] ** 2
        size = DEGREES + 2 * self.number
        return np.asarray(size * np.log1p(np.maximum(chi2, 0.0) / size))


def _sums(steps: BoxSteps, turn: Floats, shift: Floats, inverse: Floats) -> _Sums:
    """Sum over the boxes of each step what the odometry leaves."""
    place, near, good = _predicted(steps, turn, shift, inverse)
    at, left = steps.step[good], (steps.ray[:, 1:] - place)[good]
    slope = _by_errors(place[good], near[good])
    each = np.hstack(
        [
            np.ones((len(at), 1)),
            np.sum(left**2, axis=1)[:, None],
            (left[:, None] @ slope)[:, 0],
            (np.swapaxes(slope, 1, 2) @ slope).reshape(-1, 36),
        ]
    )
    total = _adder(at, len(turn)) @ each
    return _Sums(total[:, 0], total[:, 1], total[:, 2:8], total[:, 8:].reshape(-1, 6, 6))


def _adder(at: Ints, count: int) -> Any:
    """Return the matrix (count, b) that adds rows of the same step."""
    from scipy.sparse import csr_array

    return csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(count, len(at)))
