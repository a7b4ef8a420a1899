"""The settings of odometry: its noise, and how it breaks what its covariance says."""

from typing import Annotated, Literal

from pydantic import Field

from dqslam.simulation.scenario.settings import NotNegative, Positive, Settings, Share


class SlipSettings(Settings):
    """Steps on which wheels turn further than the robot moves; the covariance does not know."""

    share: Share
    """Share of the steps that slip."""
    excess: Positive
    """Measured translation of such a step, divided by the true one, minus 1."""


class JumpSettings(Settings):
    """Steps with a large error that the covariance does not know, as after lost tracking."""

    count: Annotated[int, Field(ge=1)]
    translation_sigma_m: NotNegative
    """Sigma of the error, per axis."""
    rotation_sigma_rad: NotNegative


class GapSettings(Settings):
    """Times without poses and boxes; one step with a wide, honest covariance leads across."""

    starts_s: tuple[NotNegative, ...]
    """Time of the last pose before each gap, from the start of the recording."""
    duration_s: NotNegative
    """With 0, no pose is missing, but the step that follows is the weak link."""
    translation_sigma_m: Positive
    """Sigma of the step across, per axis: the drawn and the believed one."""
    rotation_sigma_rad: Positive


class _OdometrySettings(Settings):
    noise_factor: Positive = 1.0
    """All sigmas are multiplied by this, drawn and believed ones."""
    believed_factor: Positive = 1.0
    """The sigmas of the covariance are multiplied by this too."""
    scale_error: Annotated[float, Field(gt=-1.0)] = 0.0
    """Measured translation divided by the true one, minus 1, of all steps."""
    gyro_bias_rad_per_s: float = 0.0
    """Rate by which the measured yaw is too large."""
    slips: SlipSettings | None = None
    jumps: JumpSettings | None = None
    gaps: GapSettings | None = None


class PlanarOdometrySettings(_OdometrySettings):
    """Noise of the measured (v, omega) per step."""

    kind: Literal["planar"]
    translation_sigma_m: Positive
    rotation_sigma_rad: Positive
    turn_rotation_sigma_rad: Positive
    """Sigma of the rotation on the steps of a turn."""
    lateral_sigma_m: Positive
    """Sigma of sideways motion in the covariance; (v, omega) has no such motion."""
    lateral_is_drawn: bool = False
    """Whether odometry has a sideways error with this sigma, or none at all."""


class SpatialOdometrySettings(_OdometrySettings):
    """Noise of the measured motion in space, for each step and axis."""

    kind: Literal["spatial"]
    translation_sigma_m: Positive
    rotation_sigma_rad: Positive


OdometrySettings = PlanarOdometrySettings | SpatialOdometrySettings
