"""Object SLAM with dual quadrics: a Ceres core, driven from Python."""

from dqslam._core import Camera as Camera
from dqslam._core import PoseModel as PoseModel
from dqslam._core import SolveOptions as SolveOptions
from dqslam._core import Summary as Summary
from dqslam.estimate import Estimate as Estimate
from dqslam.evaluate import Report as Report
from dqslam.evaluate import absolute_trajectory_error as absolute_trajectory_error
from dqslam.evaluate import align_rigid as align_rigid
from dqslam.evaluate import evaluate as evaluate
from dqslam.experiment import run_paper as run_paper
from dqslam.io import load_recording as load_recording
from dqslam.io import save_estimate as save_estimate
from dqslam.plot import plot_maps as plot_maps
from dqslam.problem import BoxNoise as BoxNoise
from dqslam.problem import Graph as Graph
from dqslam.problem import SizePrior as SizePrior
from dqslam.problem import build_graph as build_graph
from dqslam.problem import solve as solve
from dqslam.recording import Detections as Detections
from dqslam.recording import Odometry as Odometry
from dqslam.recording import Recording as Recording
from dqslam.recording import RelativePositions as RelativePositions
from dqslam.recording import Truth as Truth
from dqslam.scenario import Scenario as Scenario
from dqslam.scenario import load_scenario as load_scenario
from dqslam.simulate import simulate as simulate
