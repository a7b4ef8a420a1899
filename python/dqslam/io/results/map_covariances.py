"""Covariances of the ellipsoids of a map, from what ``map.json`` has of them."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.io.results.load import MapObjects

# Sigmas of the center [m] and of the log axes if a result has none, as for a well measured object.
UNKNOWN_CENTER_SIGMA_M, UNKNOWN_LOG_SIGMA = 0.05, 0.1
# The sigma of an orientation [rad] if axes are equal, which do not determine it.
MAX_ANGLE_SIGMA = 0.5


def ellipsoid_covariances(objects: MapObjects, rows: Ints) -> Floats:
    """Return the covariances of the ellipsoids of some rows, shape (r, 9, 9).

    A map has the covariance of the center and the sigmas of the log semi-axes. The uncertainty of
    the orientation follows from these and the ratios of the axes.
    """
    covariances = np.zeros((len(rows), 9, 9))
    for covariance, row in zip(covariances, rows, strict=True):
        center, sigma = objects.center_covariances[row], objects.log_semi_axes_sigmas[row]
        if not np.isfinite(center).all():
            center = UNKNOWN_CENTER_SIGMA_M**2 * np.eye(3)
        if not np.isfinite(sigma).all():
            sigma = np.full(3, UNKNOWN_LOG_SIGMA)
        covariance[:3, :3] = center
        covariance[3:, 3:] = _shape_covariance(
            objects.semi_axes[row], objects.orientations[row], sigma
        )
    return covariances


def _shape_covariance(semi_axes: Floats, orientation_xyzw: Floats, log_sigma: Floats) -> Floats:
    """Return the covariance of the log-Cholesky shape, (6, 6).

    It is that of six independent changes: of the logarithms of the axes, and of the angles between
    them. A rotation by an angle a in the plane of axes i and j changes log S by
    (log s_i - log s_j) a. The sigma of an angle makes this change equal to the larger log sigma.
    """
    logs = np.log(semi_axes)
    apart = np.abs(np.roll(logs, -1) - np.roll(logs, -2)) + 1e-3
    wider = np.maximum(np.roll(log_sigma, -1), np.roll(log_sigma, -2))
    sigma = np.concatenate([log_sigma, np.minimum(wider / apart, MAX_ANGLE_SIGMA)])
    spread = _core.shape_from_axes_jacobian(semi_axes, orientation_xyzw) * sigma
    return np.asarray(spread @ spread.T + 1e-10 * np.eye(6))
