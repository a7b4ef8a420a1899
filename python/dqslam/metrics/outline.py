"""Outlines of ellipsoids in the image."""

import numpy as np

from dqslam import _core
from dqslam._checks import Floats

POINTS = 128  # an outline of 600 px then has an error of at most 0.1 px between points
_AROUND = 0.5  # share of the image's size: the lens model is not used farther outside


def project_outlines(
    camera: _core.Camera,
    world_from_camera: Floats,
    ellipsoids: Floats,
    *,
    points: int = POINTS,
) -> Floats:
    """Return the outline of ellipsoid i from pose i in undistorted pixels, shape (m, points, 2).

    The image of the dual quadric is the dual conic C* = P Q* P^T of an ellipse with center c and
    shape S, where C* ~ S - c c^T. The last point equals the first.

    Parameters
    ----------
    world_from_camera
        Shape (m, 7); the camera has no mount.
    ellipsoids
        Center and log-Cholesky shape, shape (m, 9). An outline is NaN where these are NaN, and
        where the ellipsoid is not strictly in front of the camera, because it is no ellipse there.
    """
    from scipy.spatial.transform import Rotation

    outlines = np.full((len(ellipsoids), points, 2), np.nan)
    real = np.flatnonzero(np.isfinite(ellipsoids).all(axis=1))
    if not real.size:
        return outlines
    camera_from_world = Rotation.from_quat(world_from_camera[real, 3:]).as_matrix().swapaxes(1, 2)
    lower = _factors(ellipsoids[real])
    center = np.einsum(
        "nij,nj->ni", camera_from_world, ellipsoids[real, :3] - world_from_camera[real, :3]
    )
    axes = camera_from_world @ lower  # S = axes axes^T in the frame of the camera
    front = center[:, 2] > np.linalg.norm(axes[:, 2], axis=1)
    real, center, axes = real[front], center[front], axes[front]
    project = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    center, axes = center @ project.T, project @ axes
    conic = axes @ axes.swapaxes(1, 2) - center[:, :, None] * center[:, None, :]
    conic /= conic[:, 2:, 2:]  # now [c c^T - S, c; c^T, 1]
    middle = conic[:, :2, 2]
    shape = middle[:, :, None] * middle[:, None, :] - conic[:, :2, :2]
    angle = np.linspace(0.0, 2.0 * np.pi, points)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    squares, along = np.linalg.eigh(shape)
    radii = np.sqrt(squares.clip(min=0.0))  # rounding may make the square of a tiny one negative
    outlines[real] = middle[:, None] + circle @ (along * radii[:, None]).swapaxes(1, 2)
    return outlines


def through_lens(camera: _core.Camera, outlines: Floats) -> Floats:
    """Return outlines (..., 2) in the pixels of the image as recorded, which the lens distorts.

    They are NaN well outside of the image, where the polynomials of the lens are not valid.
    """
    if not camera.has_distortion:
        return outlines
    size = np.array([camera.width, camera.height])
    far = np.any((outlines < -_AROUND * size) | (outlines > (1.0 + _AROUND) * size), axis=-1)
    hidden = far | np.isnan(outlines).any(axis=-1)
    inside = np.where(hidden[..., None], [camera.cx, camera.cy], outlines)
    bent = camera.distort_points(inside.reshape(-1, 2)).reshape(outlines.shape)
    return np.where(hidden[..., None], np.nan, bent)


def boxes_through_lens(camera: _core.Camera, boxes: Floats) -> Floats:
    """Return boxes (m, 4) in the pixels of the image as recorded, each edge taken at its middle."""
    if not camera.has_distortion:
        return boxes
    u_min, v_min, u_max, v_max = boxes.T
    u, v = (u_min + u_max) / 2.0, (v_min + v_max) / 2.0
    middles = np.stack([[u_min, v], [u, v_min], [u_max, v], [u, v_max]]).transpose(0, 2, 1)
    bent = through_lens(camera, middles)
    return np.column_stack([bent[0, :, 0], bent[1, :, 1], bent[2, :, 0], bent[3, :, 1]])


def _factors(ellipsoids: Floats) -> Floats:
    """Return L of S = L L^T, shape (m, 3, 3), from log-Cholesky parameters."""
    lower = np.zeros((len(ellipsoids), 3, 3))
    lower[:, [0, 1, 2], [0, 1, 2]] = np.exp(ellipsoids[:, 3:6])
    lower[:, [1, 2, 2], [0, 0, 1]] = ellipsoids[:, 6:]
    return lower
