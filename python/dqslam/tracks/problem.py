"""One track as a least-squares problem: its boxes, its motion, its size and the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.tracks.body import Views
from dqslam.tracks.motion import ABOVE, X, Y
from dqslam.tracks.sizes import BodySize

Trajectory = _core.TrackTrajectory
Equations = _core.TrackEquations


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
    noise: _core.MotionNoise
    ground_follows: bool = False
    """Whether the ground is known in the frame of the camera, and goes where that goes."""

    @cached_property
    def core(self) -> _core.TrackProblem:
        """What the core estimates."""
        return _core.TrackProblem(
            self.views.camera,
            self.views.axes,
            self.views.position,
            self.seconds,
            self.box,
            self.variance,
            self.truncated,
            self.plane,
            self.above,
            self.size.log_half,
            self.size.precision,
            self.noise,
            self.ground_follows,
        )

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
    return _core.linearize_track(problem.core, at, moves, first, information)
