"""Edges of boxes that the border of the image cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.recording import Recording

# Detectors stop short of the image border by a pixel or two.
BORDER_PX = 3.0


def with_cut_edges(recording: Recording) -> Recording:
    """Flag the edges of boxes that lie on the border of the image: the object may go on beyond."""
    detections = recording.detections
    truncated = detections.truncated | cut_edges(recording.camera, detections.box)
    return replace(recording, detections=replace(detections, truncated=truncated))


def cut_edges(camera: _core.Camera, box: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which edges of undistorted boxes (b, 4) lie on the border of the image as recorded."""
    border = np.array([-0.5, -0.5, camera.width - 0.5, camera.height - 0.5])
    return np.asarray(np.abs(_as_recorded(camera, box) - border) <= BORDER_PX)


def _as_recorded(camera: _core.Camera, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distort boxes again: invert ``undistort_boxes``, to a small part of a pixel."""
    if not camera.has_distortion:
        return box
    recorded = np.empty_like(box)
    for edge in range(4):
        middle = 0.5 * (box[:, :2] + box[:, 2:])
        middle[:, edge % 2] = box[:, edge]
        recorded[:, edge] = camera.distort_points(middle)[:, edge % 2]
    # An edge was undistorted at the middle of the recorded box, which is not that of the other.
    for _ in range(5):
        recorded += box - camera.undistort_boxes(recorded)
    return recorded
