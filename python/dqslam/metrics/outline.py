"""Outlines of ellipsoids in the image."""

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints

_AROUND = 0.5  # of the image's size: a lens is not believed further outside of the image


def visible_outlines(
    camera: _core.Camera,
    world_from_camera: Floats,
    ellipsoids: Floats,
    *,
    points: int = 128,
    lens: bool = False,
) -> tuple[Ints, Floats]:
    """Return which ellipsoids the image of a pose shows, far ones first, and their outlines.

    Rows (v,), and points (v, points, 2) of which the last is the first again. Whether anything
    hides an ellipsoid is not known.

    Parameters
    ----------
    world_from_camera
        Shape (7,); the camera has no mount.
    ellipsoids
        Center and log-Cholesky shape, shape (o, 9), NaN where one is none.
    lens
        The pixels are those of the image as recorded, else undistorted.
    """
    here = np.tile(world_from_camera, (len(ellipsoids), 1))
    se3 = _core.PoseModel.SE3
    outlines = _core.project_to_outlines(se3, camera, here, ellipsoids, points=points)
    if lens:
        outlines = through_lens(camera, outlines)
    low, high = np.fmin.reduce(outlines, axis=1), np.fmax.reduce(outlines, axis=1)
    last = np.array([camera.width, camera.height]) - 0.5
    rows = np.flatnonzero(np.all((high > -0.5) & (low < last), axis=1))  # not so where it is NaN
    distance = np.linalg.norm(ellipsoids[rows, :3] - world_from_camera[:3], axis=1)
    rows = rows[np.argsort(-distance, kind="stable")]
    return rows, outlines[rows]


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
