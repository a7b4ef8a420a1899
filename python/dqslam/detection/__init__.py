"""Boxes from images: a detector of the user's, as an ONNX file, run on a folder or a film.

ONNX Runtime and OpenCV, the extra ``detect``, are imported inside functions.
"""

from dqslam.detection.boxes import Boxes as Boxes
from dqslam.detection.classes import class_names as class_names
from dqslam.detection.detect import DetectOptions as DetectOptions
from dqslam.detection.detect import Found as Found
from dqslam.detection.detect import detect as detect
from dqslam.detection.layouts import LAYOUTS as LAYOUTS
from dqslam.detection.table import write_found as write_found
