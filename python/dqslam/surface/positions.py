"""Positions of objects relative to the camera, from the depth inside their boxes.

A pixel that shows an object tells the distance of its front. The body of the map says how far the
center is behind the front at that pixel. The pixels of a box vote for the distance of the center;
those of the background or of something in front of the object vote for another one.

What depth does not measure, the position across the ray, is given with the size of the object as
its sigma: boxes tell it, and must not be counted twice.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._files import write_text
from dqslam.io import Results, nearest_pose
from dqslam.recording import RelativePositions
from dqslam.surface.body import Body, bodies_of
from dqslam.surface.images import DepthImages
from dqslam.surface.surfaces import SurfaceOptions
from dqslam.surface.views import View, Views, poses_at

# The sides of a box show the background, too: only this middle part of width and height is used.
_MIDDLE = 0.8
_PIXELS = 3000  # of a box that vote, at most
# Votes of the pixels that agree: at least this share, and this number.
_LEAST_SHARE, _LEAST_VOTES = 0.3, 20
# Votes agree within this share of the body's depth, or so many sigmas of depth.
_WITHIN, _SIGMAS = 0.15, 3.0
# Sigma of the distance between front and center as a share of it, if the map does not know the
# sizes of the object, and at least: no object is an ellipsoid.
_UNKNOWN_SHAPE, _LEAST_SHAPE = 0.2, 0.1
# A center that is further from that of the map than this multiple of the body is of something else.
_FURTHEST = 2.0
_COLUMNS = ("timestamp", "object", "x", "y", "z", "c11", "c12", "c13", "c22", "c23", "c33")


def relative_positions(
    results: Results,
    depth: DepthImages,
    options: SurfaceOptions | None = None,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> RelativePositions:
    """Measure the centers of objects in the camera frame, one for each box that depth explains.

    ``pose`` are rows of the poses of the results, and ids those of the map. Boxes without an object
    that is an ellipsoid, without a depth image, or most of whose depth shows something else have
    none.

    Parameters
    ----------
    results
        Map, path and boxes, from ``load_results``.
    depth
        Images of the camera of the results; for each pose, the one nearest in time is used.

    Raises
    ------
    ValueError
        If the results have no boxes, or no image is of the time of the path.
    FileError
        If an image cannot be read, or is not of the camera's size.
    """
    how, boxes = options or SurfaceOptions(), results.boxes
    if boxes is None:
        raise ValueError(f"{results.directory}: has no boxes.csv, whose boxes positions are of")
    views = Views.along(results.camera, results.timestamps, results.poses, depth)
    bodies = bodies_of(results.objects)
    row_of = {int(number): row for row, number in enumerate(results.objects.object_ids)}
    found: list[tuple[int, int, Floats, Floats]] = []
    images = _images_of(results.timestamps, views)
    poses = np.unique(boxes.pose).tolist()
    for done, pose in enumerate(poses, start=1):
        own = [row for row in np.flatnonzero(boxes.pose == pose).tolist()
               if row_of.get(int(boxes.object_id[row]), -1) in bodies]
        if own and images[pose] >= 0:
            view = views.view(int(images[pose]))
            for row in own:
                number = int(boxes.object_id[row])
                place = row_of[number]
                sigmas = results.objects.log_semi_axes_sigmas[place]
                measured = _position(view, bodies[place], boxes.box[row], sigmas, how.depth_noise)
                if measured is not None:
                    moved = _at_pose(*measured, view, results.poses[pose])
                    found.append((pose, number, *moved))
        progress(done / len(poses))
    return RelativePositions(
        pose=np.array([one[0] for one in found], dtype=np.int64),
        object_id=np.array([one[1] for one in found], dtype=np.int64),
        object_in_robot=np.array([one[2] for one in found]).reshape(-1, 3),
        covariance=np.array([one[3] for one in found]).reshape(-1, 3, 3),
    )


def _images_of(timestamps: Floats, views: Views) -> Ints:
    """Return the place of the image of each pose, the nearest within half an interval, or -1."""
    if len(views) == 1 or len(timestamps) == 1:
        usual, rows = np.inf, np.zeros(len(timestamps), dtype=np.int64)
        off = np.abs(timestamps - views.times[0])
    else:
        usual = float(np.median(np.diff(timestamps)))
        rows, off = nearest_pose(views.times, timestamps)
    return np.where(off <= 0.5 * usual, rows, -1)


def _position(
    view: View, body: Body, box: Floats, log_sigmas: Floats, noise: float
) -> tuple[Floats, Floats] | None:
    """Return the center (3,) of an object in the camera frame, and its covariance (3, 3)."""
    u, v = _pixels(view, box)
    behind, center = _center_behind_front(view, body, u, v)
    depth = view.depth[v, u]
    votes = (depth + behind)[(depth > 0.0) & np.isfinite(behind)]
    if votes.size < _LEAST_VOTES:
        return None
    ray = center / np.linalg.norm(center)
    turn = view.world_from_camera.T @ body.world_from_object
    half = body.support(turn.T @ ray)
    sigma_depth = noise * float(np.median(votes)) ** 2
    width = max(_WITHIN * half, _SIGMAS * sigma_depth)
    votes = np.sort(votes)
    # The place where most votes lie within the width to both sides.
    count = np.searchsorted(votes, votes + width) - np.searchsorted(votes, votes - width)
    peak = votes[np.argmax(count)]
    agree = votes[np.abs(votes - peak) <= 2.0 * width]
    if count.max() < max(_LEAST_SHARE * votes.size, _LEAST_VOTES):
        return None
    distance = float(np.median(agree))
    if abs(distance - center[2]) > _FURTHEST * half:
        return None
    spread = 1.4826 * float(np.median(np.abs(agree - distance)))
    known = log_sigmas[np.isfinite(log_sigmas)]
    shape = max(float(known.max()), _LEAST_SHAPE) if known.size else _UNKNOWN_SHAPE
    along = spread**2 + sigma_depth**2 + (shape * half) ** 2
    across = float(body.semi_axes.max()) ** 2
    outer = np.outer(ray, ray)
    return center * (distance / center[2]), along * outer + across * (np.eye(3) - outer)


def _pixels(view: View, box: Floats) -> tuple[Ints, Ints]:
    """Return pixels of the middle of a box, on a grid."""
    camera, middle = view.camera, 0.5 * (box[:2] + box[2:])
    half = 0.5 * _MIDDLE * (box[2:] - box[:2])
    low = np.maximum(np.ceil(middle - half), 0).astype(int)
    high = np.minimum(np.floor(middle + half), [camera.width - 1, camera.height - 1]).astype(int)
    step = max(1, int(np.sqrt(np.prod(np.maximum(high - low, 1)) / _PIXELS)))
    u, v = np.meshgrid(np.arange(low[0], high[0] + 1, step), np.arange(low[1], high[1] + 1, step))
    return u.reshape(-1), v.reshape(-1)


def _center_behind_front(view: View, body: Body, u: Ints, v: Ints) -> tuple[Floats, Floats]:
    """Return how much deeper the center is than the front at pixels (p,), and the center (3,).

    NaN where a pixel does not show the body as it is in the map.
    """
    camera, turn = view.camera, view.world_from_camera.T @ body.world_from_object
    center = view.to_camera(body.center)
    rays = np.column_stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 0.0 * u + 1])
    d = rays @ turn / body.semi_axes
    o = center @ turn / body.semi_axes
    a, b, c = (d * d).sum(axis=1), d @ o, o @ o - 1.0
    with np.errstate(invalid="ignore"):
        front = (b - np.sqrt(b * b - a * c)) / a
    return np.where(front > 0.0, center[2] - front, np.nan), center


def _at_pose(
    center: Floats, covariance: Floats, view: View, pose: Floats
) -> tuple[Floats, Floats]:
    """Move a center in the camera of an image to the camera of a pose, a moment apart."""
    from scipy.spatial.transform import Rotation

    camera_from_world = Rotation.from_quat(pose[3:]).as_matrix().T
    turn = camera_from_world @ view.world_from_camera
    moved = camera_from_world @ (view.center - pose[:3])
    turned = turn @ covariance @ turn.T
    return turn @ center + moved, 0.5 * (turned + turned.T)


def write_positions(path: Path, results: Results, found: RelativePositions) -> None:
    """Write positions as CSV for ``dqslam run --positions``, with the times of their poses."""
    lines = [",".join(_COLUMNS)]
    rows, columns = np.triu_indices(3)
    for row in range(len(found)):
        numbers = [*found.object_in_robot[row], *found.covariance[row][rows, columns]]
        time = float(results.timestamps[found.pose[row]])
        cells = [repr(time), str(found.object_id[row]), *(f"{x:.9g}" for x in numbers)]
        lines.append(",".join(cells))
    write_text(path, "\n".join(lines) + "\n")
