"""Files in and out, one module a format: conventions and errors are stated in each."""

from dqslam.io.camera import CAMERA_FORMATS as CAMERA_FORMATS
from dqslam.io.camera import read_camera as read_camera
from dqslam.io.detections import DETECTION_FORMATS as DETECTION_FORMATS
from dqslam.io.detections import DetectionTable as DetectionTable
from dqslam.io.detections import read_class_names as read_class_names
from dqslam.io.detections import read_detections as read_detections
from dqslam.io.files import FileError as FileError
from dqslam.io.files import write_json as write_json
from dqslam.io.frames import FrameTimes as FrameTimes
from dqslam.io.frames import frame_rate as frame_rate
from dqslam.io.frames import read_frame_times as read_frame_times
from dqslam.io.recording import Dropped as Dropped
from dqslam.io.recording import OdometryNoise as OdometryNoise
from dqslam.io.recording import load_recording as load_recording
from dqslam.io.recording import nearest_pose as nearest_pose
from dqslam.io.results import save_estimate as save_estimate
from dqslam.io.sources import FormatNames as FormatNames
from dqslam.io.sources import choose_frame_times as choose_frame_times
from dqslam.io.sources import split_formats as split_formats
from dqslam.io.trajectory import TRAJECTORY_FORMATS as TRAJECTORY_FORMATS
from dqslam.io.trajectory import Trajectory as Trajectory
from dqslam.io.trajectory import read_trajectory as read_trajectory
from dqslam.io.trajectory import write_trajectory as write_trajectory
