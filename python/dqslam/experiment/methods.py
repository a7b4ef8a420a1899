"""Which estimator a trial runs, and what it is given."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

from dqslam import _core
from dqslam._core import SolveOptions
from dqslam.problem import BoxNoise
from dqslam.recording import Recording
from dqslam.scenario import Scenario

Method = Literal["dqslam", "paper"]
LossName = Literal["none", "huber", "cauchy", "dcs", "switchable", "gnc_tls", "gnc_gm"]
RowName = Literal["monocular", "relative_position"]

LOSSES: tuple[LossName, ...] = get_args(LossName)
ROWS: tuple[RowName, ...] = ("monocular", "relative_position")

# None has a lower mean RMSE_pos over seeds 0 to 19 with 20 % wrong ids, random and structured;
# that of switchable is the same.
ROBUST_LOSS: LossName = "gnc_gm"

# The paper does not state the weight Lambda of its box residual. Every decade of its sigma, in
# px^4 m^2, is tried from where boxes overrule odometry (worse than it) to where they do not count.
ALGEBRAIC_SIGMAS = tuple(float(10.0**power) for power in range(7, 15))


@dataclass(frozen=True)
class Settings:
    """What is run in each trial."""

    method: Method = "dqslam"
    loss: LossName = "none"
    bound: bool = False
    """Whether estimates are compared with the posterior bound and the optimum."""

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if self.loss not in LOSSES:
            raise ValueError(f"loss: {self.loss!r} is none of {', '.join(LOSSES)}")
        if self.method == "paper" and (self.bound or self.loss != "none"):
            raise ValueError("method: the paper's has neither a robust loss nor a bound")


def default_loss(scenario: Scenario, method: Method) -> LossName:
    """Return a robust loss where ids are wrong, none elsewhere or in the paper's method."""
    is_robust = scenario.detector.wrong_associations > 0.0 and method == "dqslam"
    return ROBUST_LOSS if is_robust else "none"


def candidate_sigmas(method: Method) -> tuple[float | None, ...]:
    """Return the algebraic sigmas that a method is run with; None: it has no such weight."""
    return ALGEBRAIC_SIGMAS if method == "paper" else (None,)


def method_options(settings: Settings, algebraic_sigma: float | None = None) -> SolveOptions:
    """Return the options of the solver: its defaults, or the paper's method as published."""
    if settings.method == "dqslam":
        return SolveOptions(loss=_core.Loss[settings.loss.upper()])
    return SolveOptions(
        residual=_core.Residual.ALGEBRAIC,
        landmark_model=_core.LandmarkModel.DUAL_QUADRIC,
        start=_core.Start.IDENTITY,
        schedule=_core.Schedule.BATCH,
        loss=_core.Loss.NONE,
        minimizer=_core.Minimizer.DOGLEG,  # never worse than Levenberg-Marquardt here, and faster
        algebraic_sigma=algebraic_sigma,
    )


def box_noise(scenario: Scenario, settings: Settings) -> BoxNoise:
    """Return what is assumed of boxes: the defaults, or what is true where a bound needs it.

    Covariances and their bound only mean something if the sigmas are right, which for ellipsoids
    is the detector's; cubes have no right one.
    """
    if settings.bound and scenario.objects == "ellipsoids":
        return BoxNoise(pixels=scenario.detector.edge_sigma_px, relative=0.0)
    return BoxNoise()


def seen_by(row: RowName, recording: Recording) -> Recording:
    """Return what the estimator of a row is given."""
    return recording if row == "relative_position" else replace(recording, positions=None)
