"""Results as COLMAP's text model: cameras.txt, images.txt and points3D.txt in a folder.

Images have the poses camera_from_world, with the quaternion's w first, and pixels are counted from
the corner of the image as recorded. A point is the center of an object, with the object's id; its
observations are the middles of the boxes that fit. The name of an image is its row in
``trajectory.txt``, with six digits, because results have no names of images.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.io.camera.colmap import write_colmap
from dqslam.io.files import whole_folder, write_text
from dqslam.io.pose_graph.graph import rotations
from dqslam.io.results import Results
from dqslam.lens import distorted_or_nan, outline_tilts, recorded_pixels

_GRAY = "128 128 128"


def write_colmap_model(folder: str | Path, results: Results) -> None:
    """Write results into a folder, which must be new or empty.

    Raises
    ------
    FileError
        If there is something in the folder, or COLMAP has no model of the lens.
    """
    observations = _observations(results)
    with whole_folder(folder) as temporary:
        write_colmap(temporary / "cameras.txt", results.camera)
        write_text(temporary / "images.txt", _images(results, observations))
        write_text(temporary / "points3D.txt", _points(results, observations))


def _observations(results: Results) -> tuple[Ints, Ints, Floats]:
    """Return pose (m,), object row (m,) and recorded pixel from the corner (m, 2) of boxes."""
    boxes, objects = results.boxes, results.objects
    if boxes is None:
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros((0, 2))
    row_of = {int(number): row for row, number in enumerate(objects.object_ids)}
    row = np.array([row_of.get(int(number), -1) for number in boxes.object_id], dtype=np.int64)
    used = np.flatnonzero((row >= 0) & boxes.inlier)
    pose, row = boxes.pose[used], row[used]
    tilts = outline_tilts(
        _core.PoseModel.SE3, results.camera, results.poses[pose], objects.ellipsoids[row]
    )
    box = boxes.box[used]
    if results.camera.has_distortion:
        box = distorted_or_nan(results.camera, box, tilts)
    seen = np.isfinite(box).all(axis=1)
    return pose[seen], row[seen], 0.5 * (box[seen, :2] + box[seen, 2:]) + 0.5


def _images(results: Results, observations: tuple[Ints, Ints, Floats]) -> Iterator[str]:
    pose, row, pixel = observations
    yield "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as (X Y POINT3D_ID)\n"
    inverse = _core.inverse(_core.PoseModel.SE3, results.poses)
    for number, (tx, ty, tz, qx, qy, qz, qw) in enumerate(inverse.tolist()):
        yield f"{number + 1} {_cells((qw, qx, qy, qz, tx, ty, tz))} 1 {number:06d}.png\n"
        here = np.flatnonzero(pose == number)
        ids = results.objects.object_ids[row[here]].tolist()
        yield (
            " ".join(
                f"{_cells(at)} {name}" for at, name in zip(pixel[here].tolist(), ids, strict=True)
            )
            + "\n"
        )


def _points(results: Results, observations: tuple[Ints, Ints, Floats]) -> Iterator[str]:
    pose, row, pixel = observations
    yield "# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n"
    order = np.argsort(pose, kind="stable")
    place = np.empty(len(pose), dtype=np.int64)
    first = np.searchsorted(pose[order], pose[order])
    place[order] = np.arange(len(pose)) - first
    error = np.linalg.norm(_centers(results, pose, row) - pixel, axis=1)
    for one, (name, center) in enumerate(
        zip(results.objects.object_ids.tolist(), results.objects.centers.tolist(), strict=True)
    ):
        track = np.flatnonzero(row == one)
        mean = float(error[track].mean()) if track.size else 0.0
        images = " ".join(f"{pose[at] + 1} {place[at]}" for at in track)
        yield f"{name} {_cells(center)} {_GRAY} {mean!r} {images}".rstrip() + "\n"


def _centers(results: Results, pose: Ints, row: Ints) -> Floats:
    """Return the recorded pixels from the corner (m, 2) of the centers of objects."""
    camera = results.camera
    turn, origin = rotations(_core.PoseModel.SE3, results.poses[pose])
    local = np.einsum("mji,mj->mi", turn, results.objects.centers[row] - origin)
    ideal = local[:, :2] / local[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return recorded_pixels(camera, ideal) + 0.5


def _cells(values: tuple[float, ...] | list[float]) -> str:
    return " ".join(map(repr, values))
