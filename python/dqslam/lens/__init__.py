"""Lens models, and boxes through lenses."""

from dqslam.lens.border import cut_edges as cut_edges
from dqslam.lens.boxes import distort_boxes as distort_boxes
from dqslam.lens.boxes import distorted_or_nan as distorted_or_nan
from dqslam.lens.boxes import edge_scales as edge_scales
from dqslam.lens.boxes import outline_tilts as outline_tilts
from dqslam.lens.boxes import undistort_boxes as undistort_boxes
from dqslam.lens.boxes import undistorted_or_nan as undistorted_or_nan
from dqslam.lens.camera import LensCamera as LensCamera
from dqslam.lens.camera import camera_with as camera_with
from dqslam.lens.camera import ideal_pixels as ideal_pixels
from dqslam.lens.camera import lens_of as lens_of
from dqslam.lens.camera import recorded_pixels as recorded_pixels
from dqslam.lens.model import PARAMETERS as PARAMETERS
from dqslam.lens.model import Lens as Lens
