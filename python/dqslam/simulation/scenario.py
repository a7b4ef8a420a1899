"""Scenarios: the settings of a simulated world, read from TOML.

Settings are only in the file; a setting with a default here is off by default. Names include
the unit.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from dqslam.config import TomlFile, check_model, read_toml

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Count = Annotated[int, Field(ge=1)]
ObjectKind = Literal["cubes", "ellipsoids"]
WrongAssociationKind = Literal["random", "structured"]


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RoundedRectangleSettings(_Settings):
    """A rounded rectangle on the plane z = 0, driven counter-clockwise."""

    kind: Literal["rounded_rectangle"]
    length_m: Positive
    width_m: Positive
    start_fraction: Annotated[float, Field(ge=0.0, le=1.0)]
    """Place on the straight part of a long side where the robot starts and ends, from 0 to 1."""
    laps: Count
    step_m: Positive
    turn_steps: Count
    """Number of steps of each 90 degree turn."""
    period_s: Positive
    """Time between two poses."""


class OrbitSettings(_Settings):
    """A hand-held, counter-clockwise path around the world's z axis that looks at the origin.

    Sigmas are the root mean square of a slow, smooth wobble.
    """

    kind: Literal["orbit"]
    turns: Positive
    poses: Annotated[int, Field(ge=2)]
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


PathSettings = RoundedRectangleSettings | OrbitSettings


class CameraSettings(_Settings):
    """A pinhole camera whose optical axis lies in the robot's x-y plane."""

    focal_length_mm: Positive
    pixel_size_um: Positive
    width_px: Count
    height_px: Count
    heading_deg: float
    """Heading of the optical axis, counter-clockwise from the robot's forward axis."""
    position_in_robot_m: tuple[float, float, float]


class LogNormalSizeSettings(_Settings):
    """Ellipsoids of any orientation that are drawn from a size prior.

    Half the logarithm of the shape S is log(median_m) I + log(spread) G, where G is symmetric and
    Gaussian with variance 1 on the diagonal and 1/2 off it.
    """

    median_m: Positive
    """Median of the geometric mean of the semi-axes."""
    spread: Annotated[float, Field(gt=1.0)]


class _ObjectSettings(_Settings):
    object_count: Count
    side_mean_m: Positive
    side_sigma_m: NotNegative
    side_min_m: Positive
    semi_axis_factor: tuple[Positive, Positive]
    """For ellipsoids: semi-axis divided by half the side of the cube, uniform between these two."""
    log_normal_size: LogNormalSizeSettings | None = None
    """For ellipsoids: sizes are drawn like this instead, and side and factor have no effect."""

    @model_validator(mode="after")
    def _factors_ascend(self) -> Self:
        if self.semi_axis_factor[0] > self.semi_axis_factor[1]:
            raise ValueError("semi_axis_factor: the first number is above the second")
        return self


class InsidePathSettings(_ObjectSettings):
    """Objects that are placed uniformly inside the path."""

    kind: Literal["inside_path"]
    margin_m: NotNegative
    """Least distance of the centers from the sides of the path."""
    height_sigma_m: NotNegative


class OnTableSettings(_ObjectSettings):
    """Objects that are placed uniformly on or above a table top at z = 0 around the origin."""

    kind: Literal["on_table"]
    length_m: Positive
    """Length along x of the region of the centers."""
    width_m: Positive
    """Width along y of the region of the centers."""
    lift_max_m: NotNegative
    """The lowest point of an object is above the table by a height uniform from 0 to this."""


WorldSettings = InsidePathSettings | OnTableSettings


class DetectorSettings(_Settings):
    """The boxes of a detector: when an object gets one, its noise, and its id."""

    min_side_px: NotNegative
    """An object is detected when the longer side of its box exceeds this."""
    edge_sigma_px: NotNegative
    truncation: Literal["discard", "clip"] = "discard"
    """Whether a box that leaves the image is discarded, or clipped to the part inside."""
    min_visible_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """With "clip": the least share of the whole box's area that must be inside of the image."""
    wrong_associations: Annotated[float, Field(ge=0.0, le=0.4)] = 0.0
    """Share of the boxes that carry the id of another detected object."""
    wrong_association_kind: WrongAssociationKind = "random"
    """Which other object: any ("random"), or the one with the nearest center ("structured")."""


class PlanarOdometrySettings(_Settings):
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


class SpatialOdometrySettings(_Settings):
    """Noise of the measured motion in space, for each step and axis."""

    kind: Literal["spatial"]
    translation_sigma_m: Positive
    rotation_sigma_rad: Positive


OdometrySettings = PlanarOdometrySettings | SpatialOdometrySettings


class RelativePositionSettings(_Settings):
    """Noise of measured object centers, in the robot frame."""

    sigma_m: Positive
    """Sigma of each axis."""


class Scenario(_Settings):
    """All settings of a simulated recording, except the seed."""

    name: str = "unnamed"
    """Name of the scenario; if it was read from a file, the file's name without suffix."""
    objects: ObjectKind
    path: Annotated[PathSettings, Field(discriminator="kind")]
    camera: CameraSettings
    world: Annotated[WorldSettings, Field(discriminator="kind")]
    detector: DetectorSettings
    odometry: Annotated[OdometrySettings, Field(discriminator="kind")]
    relative_position: RelativePositionSettings

    @model_validator(mode="after")
    def _odometry_fits_path(self) -> Self:
        fitting = "planar" if self.path.kind == "rounded_rectangle" else "spatial"
        if self.odometry.kind != fitting:
            raise ValueError(
                f"odometry.kind: expected {fitting!r} with path.kind {self.path.kind!r}"
            )
        return self


def load_scenario(source: str | Path) -> Scenario:
    """Read a scenario from a TOML file, or by the bare name of one that comes with dqslam.

    A file with `base = "NAME"` only needs the settings that differ from that scenario.

    Raises
    ------
    FileNotFoundError
        If there is no such file; the error lists the names that come with dqslam.
    FileError
        When the file is no scenario; names the file, and the line of every wrong setting.

    Examples
    --------
    >>> import dqslam as dq
    >>> scenario = dq.load_scenario("paper")
    >>> scenario.world.object_count, scenario.odometry.rotation_sigma_rad
    (10, 0.02)
    """
    path = _find(source)
    file = read_toml(path)
    settings = _with_base(file) if "base" in file.content else file.content
    return check_model(Scenario, {"name": path.stem} | settings, file)


def _with_base(file: TomlFile) -> dict[str, Any]:
    """Return the settings of the base of a file, with the changes of the file."""
    base = file.content["base"]
    if not isinstance(base, str):
        raise file.error(("base",), f"base: expected the name of a scenario, not {base!r}")
    settings = read_toml(_find(base)).content
    if "base" in settings:
        raise file.error(("base",), f"base: {base} is not whole, but has a base itself")
    return _merged(
        settings, {name: value for name, value in file.content.items() if name != "base"}
    )


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Replace settings, section by section."""
    result = base | changes
    for name in base.keys() & changes.keys():
        if isinstance(base[name], dict) and isinstance(changes[name], dict):
            result[name] = base[name] | changes[name]
    return result


def _folders() -> list[Path]:
    """Return the folders of named scenarios, in the installed package or in a checkout."""
    here = Path(__file__).resolve()
    return [root / "data" / "scenarios" for root in (here.parents[1], here.parents[3])]


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
