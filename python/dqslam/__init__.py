"""Object SLAM with dual quadrics: a Ceres core, driven from Python.

Each name is imported when it is first asked for: a command's help waits for none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers see; a test holds it and the table below together
    from dqslam._core import Camera as Camera
    from dqslam._core import Loss as Loss
    from dqslam._core import OnlineOptions as OnlineOptions
    from dqslam._core import PoseModel as PoseModel
    from dqslam._core import ScenePriors as ScenePriors
    from dqslam._core import SmoothingLevel as SmoothingLevel
    from dqslam._core import SolveOptions as SolveOptions
    from dqslam._core import Summary as Summary
    from dqslam.association import Association as Association
    from dqslam.association import associate as associate
    from dqslam.assumptions import BoxNoise as BoxNoise
    from dqslam.assumptions import OdometryNoise as OdometryNoise
    from dqslam.assumptions import SizePrior as SizePrior
    from dqslam.assumptions import SizePriors as SizePriors
    from dqslam.assumptions import load_size_priors as load_size_priors
    from dqslam.estimate import Estimate as Estimate
    from dqslam.evaluation import evaluate_results as evaluate_results
    from dqslam.graph import Graph as Graph
    from dqslam.graph import build_graph as build_graph
    from dqslam.graph import solve as solve
    from dqslam.io import load_recording as load_recording
    from dqslam.io import load_results as load_results
    from dqslam.io import save_estimate as save_estimate
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
    from dqslam.online import StepPositions as StepPositions
    from dqslam.online import steps_of as steps_of
    from dqslam.plot import plot_maps as plot_maps
    from dqslam.recording import Detections as Detections
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
    from dqslam.uncertainty import marginal_covariances as marginal_covariances
    from dqslam.uncertainty import posterior_bound as posterior_bound

_NAMES = {
    "dqslam._core": (
        "Camera",
        "Loss",
        "OnlineOptions",
        "PoseModel",
        "ScenePriors",
        "SmoothingLevel",
        "SolveOptions",
        "Summary",
    ),
    "dqslam.association": ("Association", "associate"),
    "dqslam.estimate": ("Estimate",),
    "dqslam.metrics": (
        "Report",
        "absolute_trajectory_error",
        "align_rigid",
        "evaluate",
        "relative_pose_error",
    ),
    "dqslam.evaluation": ("evaluate_results",),
    "dqslam.studies.paper": ("run_paper",),
    "dqslam.io": ("load_recording", "load_results", "save_estimate"),
    "dqslam.online": (
        "Motion",
        "OnlineSlam",
        "Step",
        "StepBoxes",
        "StepError",
        "StepPositions",
        "steps_of",
    ),
    "dqslam.plot": ("plot_maps",),
    "dqslam.graph": ("Graph", "build_graph", "solve"),
    "dqslam.recording": ("Detections", "Odometry", "Recording", "RelativePositions", "Truth"),
    "dqslam.simulation": ("Scenario", "load_scenario", "simulate"),
    "dqslam.assumptions": (
        "BoxNoise",
        "OdometryNoise",
        "SizePrior",
        "SizePriors",
        "load_size_priors",
    ),
    "dqslam.uncertainty": ("Bound", "Marginals", "marginal_covariances", "posterior_bound"),
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names}
__all__ = sorted(_HOMES)


if not TYPE_CHECKING:  # or every name would be known

    def __getattr__(name: str) -> Any:
        """Import a public name when it is first asked for (PEP 562)."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
