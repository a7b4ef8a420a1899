"""Things that move: tracks of position, heading and speed, from boxes that the map leaves over."""

from dqslam.tracks.estimate import Tracked as Tracked
from dqslam.tracks.estimate import estimate_tracks as estimate_tracks
from dqslam.tracks.mapped import find_moving as find_moving
from dqslam.tracks.reckoned import PathCovariance as PathCovariance
from dqslam.tracks.reckoned import of_cameras as of_cameras
from dqslam.tracks.reckoned import path_by_odometry as path_by_odometry
from dqslam.tracks.reckoned import reckoned_covariance as reckoned_covariance
