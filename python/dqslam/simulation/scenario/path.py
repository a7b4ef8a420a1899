"""The settings of paths."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dqslam.simulation.scenario.settings import (
    MOST_POSES,
    Count,
    NotNegative,
    Positive,
    Settings,
)


class _SteppedSettings(Settings):
    """A path that is divided into steps."""

    step_m: Positive
    """Length of a step, about that where the path has a whole number of them."""

    def length(self) -> float:
        """Return about the length of the path, m."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _has_a_number_of_steps(self) -> Self:
        steps = self.length() / self.step_m
        if steps > MOST_POSES:
            raise ValueError(f"the path has {steps:.3g} steps, more than {MOST_POSES}")
        return self


class RoundedRectangleSettings(_SteppedSettings):
    """A rounded rectangle on the plane z = 0, driven counter-clockwise."""

    kind: Literal["rounded_rectangle"]
    length_m: Positive
    width_m: Positive
    start_fraction: Annotated[float, Field(ge=0.0, le=1.0)]
    """Place on the straight part of a long side where the robot starts and ends, from 0 to 1."""
    laps: Count
    turn_steps: Count
    """Number of steps of each 90 degree turn."""
    period_s: Positive
    """Time between two poses."""

    def length(self) -> float:
        """Return about the length of the path, m."""
        return 2 * (self.length_m + self.width_m) * self.laps


class FigureOfEightSettings(_SteppedSettings):
    """Two equal circles on the plane z = 0 that share a step, from the origin along the x axis.

    The left one is driven first, counter-clockwise, then the right one, clockwise.
    """

    kind: Literal["figure_of_eight"]
    radius_m: Positive
    laps: Count
    """Number of times that both circles are driven."""
    period_s: Positive
    """Time between two poses."""

    def length(self) -> float:
        """Return about the length of the path, m."""
        return 4 * math.pi * self.radius_m * self.laps


class StraightSettings(_SteppedSettings):
    """A straight line on the plane z = 0, from the origin along the x axis."""

    kind: Literal["straight"]
    length_m: Positive
    period_s: Positive
    """Time between two poses."""

    def length(self) -> float:
        """Return about the length of the path, m."""
        return self.length_m


class OrbitSettings(Settings):
    """A hand-held, counter-clockwise path around the world's z axis that looks at the origin.

    Sigmas are the root mean square of a slow, smooth wobble.
    """

    kind: Literal["orbit"]
    turns: Positive
    poses: Annotated[int, Field(ge=2, le=MOST_POSES)]
    distance_m: Positive
    """Distance from the axis."""
    distance_sigma_m: NotNegative
    height_m: float
    """Height above the plane z = 0."""
    height_sigma_m: NotNegative
    roll_sigma_deg: NotNegative
    pitch_sigma_deg: NotNegative
    yaw_sigma_deg: NotNegative
    period_s: Positive
    """Time between two poses."""


class FlightSettings(_SteppedSettings):
    """A flight around an ellipse in space, counter-clockwise, that rises and falls twice a lap.

    The robot looks along its path and leans into the turn. Sigmas are the root mean square of a
    slow, smooth wobble.
    """

    kind: Literal["flight"]
    length_m: Positive
    """Diameter along x."""
    width_m: Positive
    """Diameter along y."""
    height_m: float
    """Mean height above the plane z = 0."""
    climb_m: NotNegative
    """Amplitude of the height."""
    bank_deg: float
    """Roll into the turn."""
    laps: Positive
    roll_sigma_deg: NotNegative
    pitch_sigma_deg: NotNegative
    yaw_sigma_deg: NotNegative
    period_s: Positive
    """Time between two poses."""

    def length(self) -> float:
        """Return about the length of the path, m."""
        return math.pi * (self.length_m + self.width_m) * self.laps


PathSettings = (
    RoundedRectangleSettings
    | FigureOfEightSettings
    | StraightSettings
    | OrbitSettings
    | FlightSettings
)
SPATIAL = ("orbit", "flight")
"""Kinds of paths that leave the plane."""
