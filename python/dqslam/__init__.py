"""Object SLAM with dual quadrics: a Ceres core, driven from Python.

Each name is imported when it is first asked for: a command's help waits for none of them.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers see; a test holds it and the table below together
    from dqslam._core import Camera as Camera
    from dqslam._core import Loss as Loss
    from dqslam._core import OnlineOptions as OnlineOptions
    from dqslam._core import PoseModel as PoseModel
    from dqslam._core import ScenePriors as ScenePriors
    from dqslam._core import SolveOptions as SolveOptions
    from dqslam._core import Summary as Summary
    from dqslam.associate import Association as Association
    from dqslam.associate import associate as associate
    from dqslam.estimate import Estimate as Estimate
    from dqslam.evaluate import Report as Report
    from dqslam.evaluate import absolute_trajectory_error as absolute_trajectory_error
    from dqslam.evaluate import align_rigid as align_rigid
    from dqslam.evaluate import evaluate as evaluate
    from dqslam.evaluate import relative_pose_error as relative_pose_error
    from dqslam.evaluate_results import evaluate_results as evaluate_results
    from dqslam.experiment import run_paper as run_paper
    from dqslam.io import load_recording as load_recording
    from dqslam.io import load_results as load_results
    from dqslam.io import save_estimate as save_estimate
    from dqslam.online import Motion as Motion
    from dqslam.online import OnlineSlam as OnlineSlam
    from dqslam.online import Step as Step
    from dqslam.online import StepBoxes as StepBoxes
    from dqslam.online import StepError as StepError
    from dqslam.online import StepPositions as StepPositions
    from dqslam.online import steps_of as steps_of
    from dqslam.plot import plot_maps as plot_maps
    from dqslam.problem import BoxNoise as BoxNoise
    from dqslam.problem import Graph as Graph
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
    from dqslam.size_prior import SizePrior as SizePrior
    from dqslam.size_prior import SizePriors as SizePriors
    from dqslam.size_prior import load_size_priors as load_size_priors
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
        "SolveOptions",
        "Summary",
    ),
    "dqslam.associate": ("Association", "associate"),
    "dqslam.estimate": ("Estimate",),
    "dqslam.evaluate": (
        "Report",
        "absolute_trajectory_error",
        "align_rigid",
        "evaluate",
        "relative_pose_error",
    ),
    "dqslam.evaluate_results": ("evaluate_results",),
    "dqslam.experiment": ("run_paper",),
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
    "dqslam.problem": ("BoxNoise", "Graph", "build_graph", "solve"),
    "dqslam.recording": ("Detections", "Odometry", "Recording", "RelativePositions", "Truth"),
    "dqslam.scenario": ("Scenario", "load_scenario"),
    "dqslam.simulate": ("simulate",),
    "dqslam.size_prior": ("SizePrior", "SizePriors", "load_size_priors"),
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


class _Package(ModuleType):
    """The package, whose functions are not hidden by the modules of the same name."""

    def __setattr__(self, name: str, value: object) -> None:
        # Importing dqslam.simulate would put that module where the function `simulate` belongs.
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
