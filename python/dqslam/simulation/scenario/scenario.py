"""A whole scenario."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from dqslam.simulation.scenario.calibration import CalibrationErrorSettings
from dqslam.simulation.scenario.camera import CameraSettings
from dqslam.simulation.scenario.detector import DetectorSettings
from dqslam.simulation.scenario.odometry import OdometrySettings
from dqslam.simulation.scenario.path import SPATIAL, PathSettings
from dqslam.simulation.scenario.settings import Positive, Settings
from dqslam.simulation.scenario.world import ObjectKind, WorldSettings


class RelativePositionSettings(Settings):
    """Noise of measured object centers, in the robot frame."""

    sigma_m: Positive
    """Sigma of each axis."""


class Scenario(Settings):
    """All settings of a simulated recording, except the seed."""

    name: str = "unnamed"
    """Name of the scenario; if it was read from a file, the file's name without suffix."""
    title: str = ""
    """The scenario in a few words, for tables."""
    objects: ObjectKind
    path: Annotated[PathSettings, Field(discriminator="kind")]
    camera: CameraSettings
    world: Annotated[WorldSettings, Field(discriminator="kind")]
    detector: DetectorSettings
    odometry: Annotated[OdometrySettings, Field(discriminator="kind")]
    relative_position: RelativePositionSettings
    calibration: CalibrationErrorSettings = CalibrationErrorSettings()

    @model_validator(mode="after")
    def _sections_fit(self) -> Self:
        fitting = "spatial" if self.path.kind in SPATIAL else "planar"
        if self.odometry.kind != fitting:
            raise ValueError(
                f"odometry.kind: expected {fitting!r} with path.kind {self.path.kind!r}"
            )
        if self.objects == "cubes" and self.world.proportions is not None:
            raise ValueError('world.proportions: cubes have none; say objects = "cuboids"')
        return self
