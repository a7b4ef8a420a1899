"""Errors of boxes that repeat from image to image, as a Gaussian process over the viewpoint.

An object is no ellipsoid, and a detector draws the same object from nearly the same side in nearly
the same way. The distance of an edge from the outline therefore has two parts: one that is new in
each image, and one that changes slowly as the camera moves around the object. The second has
correlation exp(-d / angle) between two views of an object, d the angle between their directions
together with the logarithm of the ratio of their distances. Many similar views then agree on where
the camera moves, but not on where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.assumptions import BoxNoise

# Views of an object that are so far apart [rad] have a correlation of 1 / e.
CORRELATION_ANGLE = 0.7
# Where the levels begin. Those of detectors on tables, streets and desks are 0.3 to 0.6 px and 0.4
# to 1 % of the side for what is new, 0.8 to 1.5 px and 2 to 4 % for what repeats.
FIRST_NEW = BoxNoise(pixels=0.7, relative=0.01)
FIRST_REPEATED = BoxNoise(pixels=1.5, relative=0.03)
# What was believed weighs as much as so many edges.
PRIOR_EDGES = 10.0
# Variances change by this factor at most in one correction.
MAX_RATIO = 10.0
# No edge is drawn better than this, no outline repeats itself more exactly [px, share of a side].
LEAST_PIXELS, LEAST_RELATIVE = 0.1, 1e-4
# With more noise, any boxes fit any objects.
MOST_PIXELS, MOST_RELATIVE = 10.0, 0.15


@dataclass(frozen=True)
class RepeatedNoise:
    """The distance of a box edge from the outline, in two independent parts."""

    new: BoxNoise = FIRST_NEW
    """Independent in each image."""
    repeated: BoxNoise = FIRST_REPEATED
    """The same in images from the same viewpoint."""
    angle: float = CORRELATION_ANGLE
    """Views so far apart, radians, have a correlation of 1 / e in the second part."""

    @property
    def total(self) -> BoxNoise:
        """Both together, as they are in one box by itself."""
        return BoxNoise(
            float(np.hypot(self.new.pixels, self.repeated.pixels)),
            float(np.hypot(self.new.relative, self.repeated.relative)),
        )

    @property
    def variances(self) -> Floats:
        """Of the four parts: new pixels, new share, repeated pixels, repeated share."""
        parts = (self.new, self.repeated)
        return np.array([[part.pixels, part.relative] for part in parts]).ravel() ** 2

    def edge_variances(self, side: Floats) -> tuple[Floats, Floats]:
        """Return the variances of both parts, pixels squared, of edges with sides of any shape."""
        parts = (self.new, self.repeated)
        new, repeated = (part.pixels**2 + (part.relative * side) ** 2 for part in parts)
        return new, repeated

    def together(self, towards: Floats, side: Floats) -> Floats:
        """Return variances of edges (n, 4) with which boxes of one object tell as much as they do.

        In a problem whose boxes are independent, those of n views from one side would agree as if
        their repeated error shrank by 1 / n. It is therefore multiplied by the sum of a view's
        correlations with all, which is n in that case and 1 if no two views are alike.

        ``towards`` (n, 3) is that of ``correlation``, ``side`` (n, 4) are the sides across the
        edges, pixels.
        """
        new, repeated = self.edge_variances(side)
        return np.asarray(new + repeated * self.correlation(towards).sum(axis=1)[:, None])

    def times(self, factors: Floats) -> RepeatedNoise:
        """Return the noise of an object, whose variances are so many times as large, (2,)."""
        return self.with_variances(self.variances * np.repeat(factors, 2))

    def with_variances(self, variances: Floats) -> RepeatedNoise:
        """Return the noise with other variances of the four parts, kept within limits."""
        least = np.array([LEAST_PIXELS, LEAST_RELATIVE] * 2)
        most = np.array([MOST_PIXELS, MOST_RELATIVE] * 2)
        sigma = np.clip(np.sqrt(variances), least, most).tolist()
        return RepeatedNoise(BoxNoise(*sigma[:2]), BoxNoise(*sigma[2:]), self.angle)

    def correlation(self, towards: Floats, others: Floats | None = None) -> Floats:
        """Return the correlation of views of an object with each other, or with others (n, m).

        Both lead from the camera to the object, in the frame of the world, (n, 3) and (m, 3).
        """
        others = towards if others is None else others
        distance, other = np.linalg.norm(towards, axis=1), np.linalg.norm(others, axis=1)
        # Of nearly equal directions, the chord keeps the digits that the cosine loses.
        apart = (towards / distance[:, None])[:, None] - others / other[:, None]
        angle = 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(apart, axis=2), 0.0, 1.0))
        nearer = np.log(distance[:, None] / other)
        return np.asarray(np.exp(-np.hypot(angle, nearer) / self.angle))


@dataclass(frozen=True)
class Whitener:
    """The inverse covariance of the edges of one object's boxes, an edge of all n boxes at a time.

    Edges that tell nothing have no information.
    """

    precision: Floats
    """Shape (4, n, n)."""
    counts: Bools
    """Edges that tell something, shape (4, n)."""

    @classmethod
    def of(
        cls, noise: RepeatedNoise, correlation: Floats, side: Floats, weight: Floats, counts: Bools
    ) -> Whitener:
        """Invert the covariance of boxes with sides (4, n) [px] across the edges.

        ``weight`` (n,) is what a robust loss leaves of each box: it divides the variance of what is
        new, for a box of something else repeats nothing.
        """
        new, repeated = noise.edge_variances(side)
        sigma = np.where(counts, np.sqrt(repeated), 0.0)
        covariance = correlation * sigma[:, :, None] * sigma[:, None, :]
        diagonal = np.arange(len(weight))
        covariance[:, diagonal, diagonal] += np.where(counts, new / weight, 1.0)
        precision = np.linalg.inv(covariance)
        return cls(np.where(counts[:, :, None] & counts[:, None, :], precision, 0.0), counts)

    def components(self, correlation: Floats, side: Floats, weight: Floats) -> Floats:
        """Return the derivatives of the covariance by the four variances, (4 parts, 4, n, n)."""
        n = len(weight)
        pair = side[:, :, None] * side[:, None, :]
        of_box = np.zeros((n, n))
        np.fill_diagonal(of_box, 1.0 / weight)
        shapes = [np.broadcast_to(of_box, pair.shape), of_box * pair]
        shapes += [np.broadcast_to(correlation, pair.shape), correlation * pair]
        return np.stack(shapes)


def corrected_variances(variances: Floats, found: Floats, expected: Floats) -> Floats:
    """Return better variances, (p,): the fixed point is that of restricted maximum likelihood.

    Parameters
    ----------
    variances
        What was believed.
    found
        ``r' V r`` of each part, r the residuals times the precision, V the derivative of their
        covariance, shape (p,).
    expected
        What that is on average if the variances are right, shape (p,).
    """
    prior = PRIOR_EDGES / variances
    ratio = (found + prior) / (expected + prior)
    return np.asarray(variances * np.clip(ratio, 1.0 / MAX_RATIO, MAX_RATIO))
