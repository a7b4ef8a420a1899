"""Places: maps of one place that are aligned, merged and compared."""

from dqslam.places.landmarks import Landmarks as Landmarks
from dqslam.places.landmarks import read_landmarks as read_landmarks
