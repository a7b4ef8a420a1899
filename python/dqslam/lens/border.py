"""Edges of boxes that the border of the image cut."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.lens.boxes import distort_boxes

# Detectors stop short of the image border by a pixel or two.
BORDER_PX = 3.0


def cut_edges(camera: _core.Camera, box: Floats) -> Bools:
    """Tell which edges of undistorted boxes (b, 4) lie on the border of the image as recorded."""
    border = np.array([-0.5, -0.5, camera.width - 0.5, camera.height - 0.5])
    return np.asarray(np.abs(distort_boxes(camera, box) - border) <= BORDER_PX)
