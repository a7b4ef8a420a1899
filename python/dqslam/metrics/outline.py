"""Outlines of solids in the image."""

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.lens import recorded_pixels
from dqslam.solids import Solids, project_to_outlines, wireframe

# The lens model is used up to this share of the image's size outside of the image.
_AROUND = 0.5
_EDGE_POINTS = 17


def visible_outlines(
    camera: _core.Camera,
    world_from_camera: Floats,
    solids: Solids,
    *,
    points: int = 128,
    lens: bool = False,
) -> tuple[Ints, Floats]:
    """Return the solids in the image of a pose, far ones first, and their outlines.

    The result has the rows of the solids, shape (v,), and points in pixels, shape (v, points,
    2). The last point of an outline is its first one. Occlusion is not considered.

    Parameters
    ----------
    world_from_camera
        Shape (7,); the camera has no mount.
    lens
        Whether pixels are those of the image as recorded; they are undistorted otherwise.
    points
        The number of points of an outline.
    """
    here = np.tile(world_from_camera, (len(solids), 1))
    se3 = _core.PoseModel.SE3
    outlines = project_to_outlines(se3, camera, here, solids, points=points)
    if lens:
        outlines = through_lens(camera, outlines)
    low, high = np.fmin.reduce(outlines, axis=1), np.fmax.reduce(outlines, axis=1)
    last = np.array([camera.width, camera.height]) - 0.5
    rows = np.flatnonzero(np.all((high > -0.5) & (low < last), axis=1))  # false for NaN
    distance = np.linalg.norm(solids.centers[rows] - world_from_camera[:3], axis=1)
    rows = rows[np.argsort(-distance, kind="stable")]
    return rows, outlines[rows]


def projected_edges(
    camera: _core.Camera,
    world_from_camera: Floats,
    solids: Solids,
    row: int,
    *,
    lens: bool = False,
) -> list[Floats]:
    """Return the edges of a cuboid or a cylinder in the image of a pose, (k, 2) pixels each.

    There are none of an ellipsoid, which is its outline. All of the solid must be in front of the
    camera, which has no mount. With ``lens``, pixels are those of the image as recorded.
    """
    from scipy.spatial.transform import Rotation

    if not solids.is_body[row]:
        return []
    turn = Rotation.from_quat(world_from_camera[3:])
    share = np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None]
    edges = []
    for line in wireframe(solids, row):
        dense = line if len(line) > 2 else line[0] + share * (line[1] - line[0])
        points = turn.inv().apply(dense - world_from_camera[:3])
        pixels = points[:, :2] / points[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        edges.append(through_lens(camera, pixels) if lens else pixels)
    return edges


def through_lens(camera: _core.Camera, outlines: Floats) -> Floats:
    """Return outlines (..., 2), undistorted pixels, in the pixels of the image as recorded.

    Points far outside of the image are NaN, because the lens model is not valid there.
    """
    if not camera.has_distortion:
        return outlines
    size = np.array([camera.width, camera.height])
    far = np.any((outlines < -_AROUND * size) | (outlines > (1.0 + _AROUND) * size), axis=-1)
    hidden = far | np.isnan(outlines).any(axis=-1)
    inside = np.where(hidden[..., None], [camera.cx, camera.cy], outlines)
    bent = recorded_pixels(camera, inside)
    return np.where(hidden[..., None], np.nan, bent)
