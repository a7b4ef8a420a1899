"""Recordings through a lens: the part of the pinhole's image that it shows, and exact boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.lens import (
    LensCamera,
    distort_boxes,
    ideal_pixels,
    lens_of,
    outline_tilts,
    undistorted_or_nan,
)
from dqslam.recording import Detections, Recording
from dqslam.subgraph import rebuilt

# Points along each side of the image.
_SIDE_POINTS = 65


def widened(recording: Recording) -> tuple[Recording, Floats]:
    """Return the recording with an image that has all that its lens shows, and its offset [px].

    Of the image as recorded, the pinhole's image may show more than a rectangle of the same size
    has. Here it is moved by the offset (2,), so that the larger rectangle begins at -0.5.
    """
    camera, boxes = recording.camera, recording.detections.box
    if not camera.has_distortion:
        return recording, np.zeros(2)
    # Beyond the range of the lens there is no border; then the boxes say how far the image goes.
    wide, offset = wide_camera(camera, boxes.reshape(-1, 2))
    detections = replace(recording.detections, box=boxes + np.tile(offset, 2))
    return replace(recording, camera=wide, detections=detections), offset


def wide_camera(camera: _core.Camera, points: Floats) -> tuple[_core.Camera, Floats]:
    """Return a camera whose image has all that a lens shows, and points (n, 2) of the pinhole.

    Its image begins at -0.5. What was at a point of the pinhole's image is moved by the offset
    (2,), which is returned, too.
    """
    size = np.array([camera.width, camera.height])
    share = np.linspace(0.0, 1.0, _SIDE_POINTS)
    sides = [np.column_stack([share, end]) for end in (0 * share, 0 * share + 1)]
    border = np.concatenate([*sides, *(side[:, ::-1] for side in sides)]) * size - 0.5
    shown = np.concatenate([ideal_pixels(camera, border), points, [[-0.5, -0.5], size - 0.5]])
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    offset = np.ceil(-0.5 - low)
    wide = LensCamera(
        camera.fx,
        camera.fy,
        camera.cx + offset[0],
        camera.cy + offset[1],
        *np.ceil(high + offset + 0.5).astype(int).tolist(),
        lens=lens_of(camera),
        robot_from_camera=camera.robot_from_camera,
    )
    return wide, offset


def exact_boxes(
    camera: _core.Camera,
    model: _core.PoseModel,
    poses: Floats,
    ellipsoids: Floats,
    boxes: Floats,
) -> Floats:
    """Undistort again boxes (m, 4) that were undistorted without their objects.

    ``poses`` (m, d) and ``ellipsoids`` (m, 9) are those of the boxes. Where an ellipsoid is not in
    front of its camera, or is NaN, the box stays as it is.
    """
    if not camera.has_distortion or not len(boxes):
        return boxes
    tilts = np.full(len(boxes), np.nan)
    real = np.flatnonzero(np.isfinite(ellipsoids).all(axis=1))
    tilts[real] = outline_tilts(model, camera, poses[real], ellipsoids[real])
    exact = undistorted_or_nan(camera, distort_boxes(camera, boxes), tilts, near=boxes)
    return np.where(np.isnan(exact), boxes, exact)


def with_exact_boxes(
    core: _core.Graph, camera: _core.Camera, boxes: Floats, state: _core.State
) -> _core.Graph:
    """Return a problem with its boxes (b, 4) undistorted for the objects of a state."""
    table = core.boxes
    exact = exact_boxes(
        camera, core.pose_model, state.poses[table.pose], state.landmarks[table.object], boxes
    )
    changed = _core.BoxTable(
        pose=table.pose,
        object=table.object,
        box=exact,
        covariance=table.covariance,
        truncated=table.truncated,
    )
    return rebuilt(core, boxes=changed)


def detections_with_exact_boxes(
    camera: _core.Camera,
    model: _core.PoseModel,
    poses: Floats,
    object_ids: Ints,
    ellipsoids: Floats,
    detections: Detections,
) -> Detections:
    """Return detections with the boxes of mapped objects undistorted for these."""
    if not camera.has_distortion or not len(object_ids):
        return detections
    row = np.searchsorted(object_ids, detections.object_id).clip(max=len(object_ids) - 1)
    mapped = np.flatnonzero(object_ids[row] == detections.object_id)
    box = detections.box.copy()
    box[mapped] = exact_boxes(
        camera, model, poses[detections.pose[mapped]], ellipsoids[row[mapped]], box[mapped]
    )
    return replace(detections, box=box)
