"""The input of an estimator (Recording), and the truth for its evaluation (Truth).

Conventions are those of the core (blocks.h): SE(2) poses [x, y, theta], SE(3) poses
[tx, ty, tz, qx, qy, qz, qw], meters, radians, pixels, seconds; boxes [u_min, v_min, u_max, v_max]
with whole numbers at pixel centers. d is the pose size (3 or 7), k the tangent size (3 or 6).
Every array is copied, checked and made read-only. Errors name the array and the row.
"""

from dqslam.recording.closures import AbsolutePositions as AbsolutePositions
from dqslam.recording.closures import LoopClosures as LoopClosures
from dqslam.recording.detections import Detections as Detections
from dqslam.recording.measurements import Measurements as Measurements
from dqslam.recording.odometry import Odometry as Odometry
from dqslam.recording.poses import as_poses as as_poses
from dqslam.recording.poses import pose_model_of as pose_model_of
from dqslam.recording.poses import pose_size as pose_size
from dqslam.recording.poses import tangent_size as tangent_size
from dqslam.recording.positions import RelativePositions as RelativePositions
from dqslam.recording.recording import Recording as Recording
from dqslam.recording.truth import Truth as Truth
