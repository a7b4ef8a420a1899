"""Object SLAM with dual quadrics: a C++ core with Ceres costs, driven from Python.

Each name is imported when it is first asked for: a command's help waits for none of them.
"""

TYPE_CHECKING = False  # type checkers know better; typing's own takes longer to import than this

if TYPE_CHECKING:  # the one list of public names, a line each: lazy_exports reads it, too
    from dqslam import association as association
    from dqslam import assumptions as assumptions
    from dqslam import evaluation as evaluation
    from dqslam import inspection as inspection
    from dqslam import io as io
    from dqslam import lens as lens
    from dqslam import metrics as metrics
    from dqslam import online as online
    from dqslam import pipeline as pipeline
    from dqslam import plot as plot
    from dqslam import simulation as simulation
    from dqslam import studies as studies
    from dqslam import view as view
    from dqslam._core import Backend as Backend
    from dqslam._core import Camera as Camera
    from dqslam._core import LandmarkModel as LandmarkModel
    from dqslam._core import Loss as Loss
    from dqslam._core import Minimizer as Minimizer
    from dqslam._core import Mode as Mode
    from dqslam._core import OnlineOptions as OnlineOptions
    from dqslam._core import PoseModel as PoseModel
    from dqslam._core import Residual as Residual
    from dqslam._core import ScenePriors as ScenePriors
    from dqslam._core import Schedule as Schedule
    from dqslam._core import SmoothingLevel as SmoothingLevel
    from dqslam._core import SolveOptions as SolveOptions
    from dqslam._core import Start as Start
    from dqslam._core import State as State
    from dqslam._core import StepReport as StepReport
    from dqslam._core import Summary as Summary
    from dqslam._core import VariableKind as VariableKind
    from dqslam.absolute import solve_with_absolute_positions as solve_with_absolute_positions
    from dqslam.association import Association as Association
    from dqslam.association import associate as associate
    from dqslam.assumptions import BoxNoise as BoxNoise
    from dqslam.assumptions import OdometryNoise as OdometryNoise
    from dqslam.assumptions import SizePrior as SizePrior
    from dqslam.assumptions import SizePriors as SizePriors
    from dqslam.assumptions import load_size_priors as load_size_priors
    from dqslam.calibration import CalibrationFinding as CalibrationFinding
    from dqslam.calibration import calibration_parameters as calibration_parameters
    from dqslam.calibration import check_calibration as check_calibration
    from dqslam.calibration import solve_with_calibration as solve_with_calibration
    from dqslam.estimate import Estimate as Estimate
    from dqslam.evaluation import evaluate_results as evaluate_results
    from dqslam.exchange import pose_graph as pose_graph
    from dqslam.graph import Graph as Graph
    from dqslam.graph import build_graph as build_graph
    from dqslam.graph import solve as solve
    from dqslam.io import load_recording as load_recording
    from dqslam.io import load_results as load_results
    from dqslam.io import save_estimate as save_estimate
    from dqslam.lens import Lens as Lens
    from dqslam.lens import LensCamera as LensCamera
    from dqslam.metrics import Report as Report
    from dqslam.metrics import absolute_trajectory_error as absolute_trajectory_error
    from dqslam.metrics import align_rigid as align_rigid
    from dqslam.metrics import evaluate as evaluate
    from dqslam.metrics import relative_pose_error as relative_pose_error
    from dqslam.online import Motion as Motion
    from dqslam.online import OnlineSlam as OnlineSlam
    from dqslam.online import Step as Step
    from dqslam.online import StepBoxes as StepBoxes
    from dqslam.online import StepError as StepError
    from dqslam.online import StepMeasurements as StepMeasurements
    from dqslam.online import StepPositions as StepPositions
    from dqslam.online import steps_of as steps_of
    from dqslam.pipeline import RunFilesOptions as RunFilesOptions
    from dqslam.pipeline import RunOptions as RunOptions
    from dqslam.pipeline import RunResult as RunResult
    from dqslam.pipeline import run as run
    from dqslam.pipeline import run_files as run_files
    from dqslam.places.changes import Change as Change
    from dqslam.places.changes import Changes as Changes
    from dqslam.places.changes import changes as changes
    from dqslam.places.locate import Candidate as Candidate
    from dqslam.places.locate import Location as Location
    from dqslam.places.locate import locate as locate
    from dqslam.places.locate_map import PlaceMap as PlaceMap
    from dqslam.plot import plot_maps as plot_maps
    from dqslam.recording import AbsolutePositions as AbsolutePositions
    from dqslam.recording import Detections as Detections
    from dqslam.recording import LoopClosures as LoopClosures
    from dqslam.recording import Measurements as Measurements
    from dqslam.recording import Odometry as Odometry
    from dqslam.recording import Recording as Recording
    from dqslam.recording import RelativePositions as RelativePositions
    from dqslam.recording import Truth as Truth
    from dqslam.simulation import Scenario as Scenario
    from dqslam.simulation import load_scenario as load_scenario
    from dqslam.simulation import simulate as simulate
    from dqslam.studies.paper import run_paper as run_paper
    from dqslam.uncertainty import Bound as Bound
    from dqslam.uncertainty import Marginals as Marginals
    from dqslam.uncertainty import UnderConstrained as UnderConstrained
    from dqslam.uncertainty import marginal_covariances as marginal_covariances
    from dqslam.uncertainty import posterior_bound as posterior_bound
else:
    from dqslam._lazy import lazy_exports

    __getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
