"""Edges of boxes that the border of the image cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.lens import distort_boxes
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
    return np.asarray(np.abs(distort_boxes(camera, box) - border) <= BORDER_PX)
