"""Files in and out, one module a format: conventions and errors are stated in each."""

from dqslam.io.camera import read_camera as read_camera
from dqslam.io.detections import DetectionTable as DetectionTable
from dqslam.io.detections import read_detections as read_detections
from dqslam.io.files import FileError as FileError
from dqslam.io.files import write_json as write_json
from dqslam.io.recording import Dropped as Dropped
from dqslam.io.recording import OdometryNoise as OdometryNoise
from dqslam.io.recording import load_recording as load_recording
from dqslam.io.recording import nearest_pose as nearest_pose
from dqslam.io.results import BoxTable as BoxTable
from dqslam.io.results import MapObjects as MapObjects
from dqslam.io.results import Results as Results
from dqslam.io.results import load_results as load_results
from dqslam.io.results import save_estimate as save_estimate
from dqslam.io.trajectory import Trajectory as Trajectory
from dqslam.io.trajectory import read_trajectory as read_trajectory
from dqslam.io.trajectory import write_trajectory as write_trajectory
