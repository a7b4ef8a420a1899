"""The settings of the objects of a world: kinds, sizes, shapes and places."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dqslam.simulation.scenario.settings import Count, NotNegative, Positive, Settings

ObjectKind = Literal["cubes", "ellipsoids", "cuboids"]
Spread = Annotated[float, Field(gt=1.0)]


class LogNormalSizeSettings(Settings):
    """Ellipsoids of any orientation that are drawn from a size prior.

    Half the logarithm of the shape S is log(median_m) I + log(spread) G, where G is symmetric and
    Gaussian with variance 1 on the diagonal and 1/2 off it.
    """

    median_m: Positive
    """Median of the geometric mean of the semi-axes."""
    spread: Spread


class ProportionSettings(Settings):
    """Objects of equal proportions: needles (1, 1, 6), plates (6, 6, 0.3), or what is wanted."""

    ratio: tuple[Positive, Positive, Positive]
    """The ratio of the semi-axes, or of the sides of cuboids."""
    median_m: Positive
    """Median of the geometric mean of the semi-axes, or of half the sides."""
    spread: Annotated[float, Field(ge=1.0)]
    """Two of three of these means are between median / spread and median * spread."""
    orientation: Literal["upright", "any"]
    """With "upright" the third axis is vertical and the yaw uniform."""


class _ObjectSettings(Settings):
    object_count: Count
    side_mean_m: Positive
    side_sigma_m: NotNegative
    side_min_m: Positive
    semi_axis_factor: tuple[Positive, Positive]
    """For ellipsoids and cuboids: semi-axis, or half a side, divided by half the side of the cube,
    uniform between these two."""
    log_normal_size: LogNormalSizeSettings | None = None
    """For ellipsoids and cuboids: sizes are drawn like this instead, and side and factor have no
    effect."""
    proportions: ProportionSettings | None = None
    """For ellipsoids and cuboids: likewise, but all objects have the same proportions."""
    class_count: Count = 1
    """Number of classes; the objects take turns."""

    @model_validator(mode="after")
    def _sizes_are_clear(self) -> Self:
        if self.semi_axis_factor[0] > self.semi_axis_factor[1]:
            raise ValueError("semi_axis_factor: the first number is above the second")
        if self.log_normal_size is not None and self.proportions is not None:
            raise ValueError("log_normal_size and proportions both give the sizes")
        return self


class InsidePathSettings(_ObjectSettings):
    """Objects that are placed uniformly inside the path."""

    kind: Literal["inside_path"]
    margin_m: NotNegative
    """Least distance of the centers from the sides of the path."""
    height_sigma_m: NotNegative
    height_mean_m: float = 0.0
    """Mean height of the centers."""


class AlongPathSettings(_ObjectSettings):
    """Objects beside the path, uniformly along it."""

    kind: Literal["along_path"]
    distance_min_m: Positive
    """Least horizontal distance of the centers from every place of the path."""
    distance_max_m: Positive
    """Largest horizontal distance of the centers from the place that they are beside."""
    sides: Literal["left", "right", "both"]
    height_sigma_m: NotNegative

    @model_validator(mode="after")
    def _distances_ascend(self) -> Self:
        if self.distance_min_m > self.distance_max_m:
            raise ValueError("distance_min_m is above distance_max_m")
        return self


class OnTableSettings(_ObjectSettings):
    """Objects that are placed uniformly on or above a table top at z = 0 around the origin."""

    kind: Literal["on_table"]
    length_m: Positive
    """Length along x of the region of the centers."""
    width_m: Positive
    """Width along y of the region of the centers."""
    lift_max_m: NotNegative
    """The lowest point of an object is above the table by a height uniform from 0 to this."""


WorldSettings = InsidePathSettings | AlongPathSettings | OnTableSettings
