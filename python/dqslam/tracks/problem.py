"""One track as a least-squares problem: its boxes, its motion, its size and the ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.tracks.body import PredictedBoxes, Views, predict_boxes
from dqslam.tracks.motion import (
    ABOVE,
    HEADING,
    SIZE,
    SPEED,
    TURN,
    MotionNoise,
    X,
    Y,
    compare_steps,
    first_sigmas,
)
from dqslam.tracks.sizes import BodySize

# Boxes that do not fit are forgiven as errors of a Student t distribution of so many degrees.
FREEDOM = 4.0
# The ground's error is that of another place after so long [s]; where the ground is unknown, things
# rise or sink by so much at most, m / sqrt(s).
FORGOTTEN_AFTER_S, MOST_DRIFT = 5.0, 0.5


@dataclass(frozen=True, eq=False)
class TrackProblem:
    """The boxes of one thing, one an image, and what is known of its kind beforehand."""

    views: Views
    seconds: Floats
    """Times of the images, strictly increasing, shape (n,)."""
    box: Floats
    """Pixels of the pinhole, shape (n, 4)."""
    variance: Floats
    """Of each edge, pixels squared, shape (n, 4)."""
    truncated: Bools
    """Edges beyond which the thing may go on, shape (n, 4)."""
    plane: Floats
    """The ground c + a x + b y of each image, rows of c, a, b; shape (n, 3)."""
    above: Floats
    """Sigma of the height of the foot above it, meters, shape (n,)."""
    size: BodySize
    noise: MotionNoise
    ground_follows: bool = False
    """Whether the ground is known in the frame of the camera, and goes where that goes."""

    def select(self, rows: Bools) -> TrackProblem:
        """Return the problem of some of the boxes, by a flag for each (n,)."""
        return replace(
            self,
            views=self.views.select(rows),
            seconds=self.seconds[rows],
            box=self.box[rows],
            variance=self.variance[rows],
            truncated=self.truncated[rows],
            plane=self.plane[rows],
            above=self.above[rows],
        )

    def moved(self, motion: Floats) -> TrackProblem:
        """Return the problem with its cameras moved, each in its own frame [m, rad], (n, 6)."""
        from scipy.spatial.transform import Rotation

        views = self.views
        turned = views.rotation @ Rotation.from_rotvec(motion[:, 3:]).as_matrix()
        position = views.position + np.einsum("nij,nj->ni", views.rotation, motion[:, :3])
        plane = self.plane
        if self.ground_follows:
            turn = turned @ views.rotation.transpose(0, 2, 1)
            below = views.position.copy()
            below[:, 2] = plane[:, 0] + np.sum(plane[:, 1:] * below[:, :2], axis=1)
            below = position + np.einsum("nij,nj->ni", turn, below - views.position)
            normal = np.einsum("nij,nj->ni", turn, self._normals())
            slope = -normal[:, :2] / normal[:, 2:]
            plane = np.column_stack([below[:, 2] - np.sum(slope * below[:, :2], axis=1), slope])
        return replace(self, views=replace(views, rotation=turned, position=position), plane=plane)

    def rise(self, feet: Floats) -> Floats:
        """Return how the ground at feet (n, 3) rises with the motions of the cameras, (n, 6).

        Each motion is in the camera's own frame [m, rad].
        """
        if not self.ground_follows:
            return np.zeros((len(feet), 6))
        normal, turn = self._normals(), self.views.rotation
        shift = np.einsum("ni,nij->nj", normal, turn)
        lever = np.cross(feet - self.views.position, normal)
        return np.concatenate([shift, np.einsum("ni,nij->nj", lever, turn)], axis=1)

    def _normals(self) -> Floats:
        """Return normals of the ground of each image, 1 along the vertical, (n, 3)."""
        return np.column_stack([-self.plane[:, 1:], np.ones(len(self.plane))])

    def feet(self, state: Floats) -> Floats:
        """Return the feet [m] of states (n, 6), shape (n, 3)."""
        place = state[:, X : Y + 1]
        height = self.plane[:, 0] + np.sum(self.plane[:, 1:] * place, axis=1)
        return np.column_stack([place, height + self.above * state[:, ABOVE]])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States of a thing at its images, and its size."""

    state: Floats
    """x, y, height above the ground in sigmas, heading, speed, turn rate; shape (n, 6)."""
    log_half: Floats
    """Logarithms of half the length, width and height [m], shape (3,)."""


@dataclass(frozen=True, eq=False)
class CameraTerms:
    """What the normal equations of a track would have of small motions of its cameras.

    Each motion is in the camera's own frame [m, rad].
    """

    by_camera: Floats
    """Blocks of each state, and of the size, and the motion of its camera, shape (n, 9, 6)."""
    of_camera: Floats
    """Blocks of these motions, shape (n, 6, 6)."""
    gradient: Floats
    """By these motions, shape (n, 6)."""
    rest_by_state: Floats
    """Errors of the heights of what rests by the states before and after, shape (n - 1, 12)."""
    rest_by_camera: Floats
    """The same by the motions of both cameras, shape (n - 1, 12)."""


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of a track: states in a chain, and the size that all boxes share."""

    cost: float
    """Half the sum of squares, after the loss: minus the log density, up to constants."""
    diagonal: Floats
    """Blocks of the states, shape (n, 6, 6)."""
    below: Floats
    """Blocks of each state and the one before it, shape (n - 1, 6, 6)."""
    of_boxes: Floats
    """What the boxes add to the diagonal of these blocks of the states, shape (n, 6)."""
    border: Floats
    """Blocks of the states and the size, shape (n, 6, 3)."""
    corner: Floats
    """Block of the size, shape (3, 3)."""
    gradient: Floats
    """Of the states, shape (n, 6)."""
    gradient_size: Floats
    """Shape (3,)."""
    log_density: float
    """What the cost lacks of minus the log density of motion and size: minus this."""
    chi2: Floats
    """Of each box, shape (n,)."""
    _make_cameras: Callable[[], CameraTerms]

    @cached_property
    def cameras(self) -> CameraTerms:
        """The motions of the cameras; the states of most equations are solved for without them."""
        return self._make_cameras()


def linearize(
    problem: TrackProblem,
    at: Trajectory,
    moves: Bools,
    first: Floats,
    *,
    information: float = 1.0,
) -> Equations | None:
    """Return the normal equations at some states, or None where a box is undefined.

    ``moves`` (n - 1,) tells whether the thing moves between images, ``first`` (6,) is the middle
    of the prior of its first state. ``information`` is what the squared errors of boxes are
    multiplied by, beside their weights.
    """
    state, count = at.state, len(at.state)
    half = np.exp(at.log_half)
    feet = problem.feet(state)
    seen = predict_boxes(problem.views, feet, state[:, HEADING], half)
    if not (seen.is_whole | (seen.in_front & problem.truncated.any(axis=1))).all():
        return None
    sigma = np.sqrt(problem.variance)
    error = (seen.box - problem.box) / sigma
    is_kept = _only_bounds(problem, seen)
    error = np.where(is_kept, 0.0, error)
    chi2 = np.sum(error**2, axis=1)
    weight = information * (FREEDOM + 4.0) / (FREEDOM + chi2)
    scale = np.where(is_kept, 0.0, np.sqrt(weight)[:, None] / sigma)[:, :, None]
    error = error * np.sqrt(weight)[:, None]
    by_state = np.zeros((count, 4, SIZE))
    slope = problem.plane[:, None, 1:]
    by_state[..., :ABOVE] = seen.by_place[..., :2] + seen.by_place[..., 2:3] * slope
    by_state[..., ABOVE] = seen.by_place[..., 2] * problem.above[:, None]
    by_state[..., HEADING] = seen.by_place[..., 3]
    by_state, by_size = scale * by_state, scale * seen.by_size
    transposed = by_state.transpose(0, 2, 1)
    diagonal = transposed @ by_state
    of_boxes = np.diagonal(diagonal, axis1=1, axis2=2).copy()
    gradient = np.einsum("nij,nj->ni", transposed, error)
    cost = 0.5 * information * (FREEDOM + 4.0) * float(np.log1p(chi2 / FREEDOM).sum())

    drift = min(FORGOTTEN_AFTER_S**-0.5, MOST_DRIFT / float(np.median(problem.above)))
    seconds, plane, above = np.diff(problem.seconds), problem.plane, problem.above
    steps = compare_steps(state, seconds, moves, problem.noise, drift, plane, above)
    back, on = steps.by_from.transpose(0, 2, 1), steps.by_to.transpose(0, 2, 1)
    diagonal[:-1] += back @ steps.by_from
    diagonal[1:] += on @ steps.by_to
    gradient[:-1] += np.einsum("nij,nj->ni", back, steps.error)
    gradient[1:] += np.einsum("nij,nj->ni", on, steps.error)

    def cameras() -> CameraTerms:
        rise = problem.rise(feet)
        by_camera = scale * (seen.by_camera + seen.by_place[..., 2:3] * rise[:, None])
        # Where the ground follows the cameras, the height in the world of what rests does, too.
        to_rise = np.where(moves, 0.0, steps.by_to[:, ABOVE, ABOVE] / above[1:])[:, None]
        rest_by_camera = np.concatenate([-to_rise * rise[:-1], to_rise * rise[1:]], axis=1)
        gradient = np.einsum("nij,ni->nj", by_camera, error)
        pull = rest_by_camera * steps.error[:, ABOVE, None]
        gradient[:-1] += pull[:, :6]
        gradient[1:] += pull[:, 6:]
        both = np.concatenate([by_state, by_size], axis=2).transpose(0, 2, 1)
        return CameraTerms(
            both @ by_camera,
            by_camera.transpose(0, 2, 1) @ by_camera,
            gradient,
            np.concatenate([steps.by_from[:, ABOVE], steps.by_to[:, ABOVE]], axis=1),
            rest_by_camera,
        )

    sigmas = first_sigmas(bool(moves[0]), problem.noise)
    middle = first.copy()
    middle[[ABOVE, SPEED, TURN]] = 0.0
    off = (state[0] - middle) / sigmas
    diagonal[0] += np.diag(sigmas**-2)
    gradient[0] += off / sigmas
    off_size = at.log_half - problem.size.log_half
    precision = problem.size.precision
    cost += 0.5 * float(np.sum(steps.error**2) + off @ off + off_size @ precision @ off_size)
    return Equations(
        cost,
        diagonal,
        on @ steps.by_from,
        of_boxes,
        transposed @ by_size,
        np.einsum("nki,nkj->ij", by_size, by_size) + precision,
        gradient,
        np.einsum("nki,nk->i", by_size, error) + precision @ off_size,
        steps.log_density
        - float(np.log(sigmas).sum())
        + 0.5 * float(np.linalg.slogdet(precision)[1]),
        chi2,
        cameras,
    )


def _only_bounds(problem: TrackProblem, seen: PredictedBoxes) -> Bools:
    """Return which edges (n, 4) only bound the thing, and are kept by what is predicted.

    Those that something cuts, and of a box with such an edge also those whose corner is outside of
    the image: the thing may reach beyond them. Where a part of it is beside or behind the camera,
    it reaches beyond the edges that are cut.
    """
    camera = problem.views.camera
    size = np.array([camera.width, camera.height]) - 0.5
    outside = ((seen.corner < -0.5) | (seen.corner > size)).any(axis=2)
    outside |= ~seen.is_whole[:, None]
    is_cut = np.asarray(problem.truncated.any(axis=1))[:, None]
    cut = problem.truncated | (is_cut & outside)
    beyond = (seen.box - problem.box) * [-1.0, -1.0, 1.0, 1.0] > 0.0
    return np.asarray((cut & beyond) | (problem.truncated & ~seen.is_whole[:, None]))
