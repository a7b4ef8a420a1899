"""The lowest points of objects: their heights, and how these change with objects and direction."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.estimate import Estimate
from dqslam.solids import body_solids

# Of central differences: meters and logarithms of the parameters of objects, and radians of up.
_OF_OBJECTS, _OF_UP = 1e-5, 1e-6


def lowest_points(estimate: Estimate, up: Floats) -> Floats:
    """Return the heights of the objects' lowest points along a unit vector (3,), meters, (o,)."""
    solids = estimate.solids
    return np.asarray(solids.centers @ up - solids.support(up))


def gradients_by_objects(estimate: Estimate, up: Floats) -> Floats:
    """Return the derivatives of these heights by the parameters of each object, (o, 9)."""
    shapes, ellipsoids = list(estimate.object_shapes), estimate.ellipsoids
    values = estimate.landmarks if shapes else ellipsoids
    is_body = estimate.is_body[:, None]

    def heights(parameters: Floats) -> Floats:
        solids = body_solids(
            shapes,
            np.where(is_body, ellipsoids, parameters),
            parameters[:, :3],
            np.exp(np.where(is_body, parameters[:, 3:6], 0.0)),
            np.where(is_body, parameters[:, 6:9], 0.0),
        )
        return np.asarray(parameters[:, :3] @ up - solids.support(up))

    steps = _OF_OBJECTS * np.eye(9)
    columns = [heights(values + step) - heights(values - step) for step in steps]
    return np.stack(columns, axis=1) / (2.0 * _OF_OBJECTS)


def support_points(estimate: Estimate, up: Floats) -> Floats:
    """Return the lowest points, meters, (o, 3): the derivatives of their heights by ``up``."""
    axes = tangents(up)
    changes = [
        lowest_points(estimate, turned(up, _OF_UP * axis))
        - lowest_points(estimate, turned(up, -_OF_UP * axis))
        for axis in axes
    ]
    across = np.stack(changes, axis=1) / (2.0 * _OF_UP)
    return np.asarray(across @ axes + np.outer(lowest_points(estimate, up), up))


def height_sigmas(gradients: Floats, covariances: Floats) -> Floats:
    """Return the uncertainty of heights, meters, (o,).

    From their gradients (o, 9) and the covariances of the objects (o, 9, 9).
    """
    variances = np.einsum("ni,nij,nj->n", gradients, covariances, gradients)
    return np.asarray(np.sqrt(variances.clip(min=0.0)))


def tangents(up: Floats) -> Floats:
    """Return two unit vectors at right angles to a direction (3,) and to each other, (2, 3)."""
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    return np.vstack([first, np.cross(up, first)])


def turned(direction: Floats, tilt: Floats) -> Floats:
    """Return a unit vector (3,) that is moved by a tilt (3,) at right angles to it, radians."""
    angle = float(np.linalg.norm(tilt))
    return np.asarray(np.cos(angle) * direction + np.sinc(angle / np.pi) * tilt)


def tilt_between(direction: Floats, other: Floats) -> Floats:
    """Return the tilt (3,) that moves a unit vector to another one, radians."""
    across = other - (other @ direction) * direction
    sine = float(np.linalg.norm(across))
    angle = np.arctan2(sine, float(other @ direction))
    return np.asarray(across * (angle / sine if sine > 0.0 else 0.0))
