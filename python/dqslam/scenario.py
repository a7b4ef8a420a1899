"""Scenarios: the settings of a simulated world, read from TOML.

The file is the only home of the settings; what has a default here is off by default. Names carry
their unit.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Count = Annotated[int, Field(ge=1)]
ObjectKind = Literal["cubes", "ellipsoids"]
WrongAssociationKind = Literal["random", "structured"]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class PathSettings(_Settings):
    """A rounded rectangle on the plane z = 0, driven counter-clockwise."""

    length_m: Positive
    width_m: Positive
    start_fraction: Annotated[float, Field(ge=0.0, le=1.0)]
    """Where on the straight part of a long side the robot starts, and ends."""
    laps: Count
    step_m: Positive
    turn_steps: Count
    """Steps over which each 90 degree turn is spread."""
    period_s: Positive
    """Time between two poses."""


class CameraSettings(_Settings):
    """A pinhole camera with a level optical axis."""

    focal_length_mm: Positive
    pixel_size_um: Positive
    width_px: Count
    height_px: Count
    heading_deg: float
    """Of the optical axis, counter-clockwise from the robot's forward axis."""
    position_in_robot_m: tuple[float, float, float]


class WorldSettings(_Settings):
    """Objects, placed uniformly inside the path."""

    object_count: Count
    margin_m: NotNegative
    """Least distance of the centres from the sides of the path."""
    height_sigma_m: NotNegative
    side_mean_m: Positive
    side_sigma_m: NotNegative
    side_min_m: Positive
    semi_axis_factor: tuple[Positive, Positive]
    """Ellipsoids: semi-axis over half the side of the cube, uniform between these two."""

    @model_validator(mode="after")
    def _factors_ascend(self) -> Self:
        if self.semi_axis_factor[0] > self.semi_axis_factor[1]:
            raise ValueError("semi_axis_factor: the first number is above the second")
        return self


class DetectorSettings(_Settings):
    """When an object gives a box, how exact it is, and whose it is said to be."""

    min_side_px: NotNegative
    """An object is detected when the longer side of its box exceeds this."""
    edge_sigma_px: NotNegative
    truncation: Literal["discard", "clip"] = "discard"
    """What becomes of a box that leaves the image: none, or the part inside of the image."""
    min_visible_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """With "clip": the least part of the whole box's area that is inside of the image."""
    wrong_associations: Annotated[float, Field(ge=0.0, le=0.4)] = 0.0
    """Share of the boxes that carry the id of another detected object."""
    wrong_association_kind: WrongAssociationKind = "random"
    """Which one: any, or the one whose centre is nearest ("structured")."""


class OdometrySettings(_Settings):
    """Noise of the measured (v, omega) per step."""

    translation_sigma_m: Positive
    rotation_sigma_rad: Positive
    turn_rotation_sigma_rad: Positive
    """On the steps of a turn."""
    lateral_sigma_m: Positive
    """What the covariance says of sideways motion; none is simulated."""


class RelativePositionSettings(_Settings):
    """Noise of measured object centres, in the robot frame."""

    sigma_m: Positive
    """Per axis."""


class Scenario(_Settings):
    """Everything that a simulated recording is made from, except the seed."""

    objects: ObjectKind
    path: PathSettings
    camera: CameraSettings
    world: WorldSettings
    detector: DetectorSettings
    odometry: OdometrySettings
    relative_position: RelativePositionSettings


def load_scenario(source: str | Path) -> Scenario:
    """Read a scenario from a TOML file, or by the bare name of one that comes with dqslam.

    Raises
    ------
    FileNotFoundError
        When there is no such file; lists the names that come with dqslam.
    ValueError
        When the file is no scenario; names the file and every wrong setting.
    """
    path = _find(source)
    try:
        with path.open("rb") as file:
            settings = tomllib.load(file)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a TOML file: {error}") from None
    try:
        return Scenario.model_validate(settings)
    except ValidationError as error:
        raise ValueError(f"{path}: {_in_one_line(error)}") from None


def _in_one_line(error: ValidationError) -> str:
    return "; ".join(
        f"{'.'.join(map(str, item['loc']))}: {item['msg']}".removeprefix(": ")
        for item in error.errors()
    )


def _folders() -> list[Path]:
    """Where named scenarios are: in the installed package, or in a checkout."""
    here = Path(__file__).resolve()
    return [root / "data" / "scenarios" for root in (here.parent, here.parents[2])]


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.is_file():
        return path
    if path.name == str(source) and not path.suffix:
        for folder in _folders():
            if (folder / f"{source}.toml").is_file():
                return folder / f"{source}.toml"
    known = sorted({file.stem for folder in _folders() for file in folder.glob("*.toml")})
    raise FileNotFoundError(f"{source}: no such scenario; by name there are: {', '.join(known)}")
