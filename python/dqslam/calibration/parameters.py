"""The parameters of a calibration: their names, groups of them, and what is found of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam import _core

GROUPS = {
    "mount": ("mount_pitch", "mount_yaw", "mount_roll"),
    "mount_position": ("mount_forward", "mount_left", "mount_up"),
    "focal": ("focal_length",),
    "principal_point": ("principal_u", "principal_v"),
    "k1": ("distortion",),
}
"""Names that stand for one or more parameters."""

# The tests are linear: where a larger value explains the residuals best, something else is wrong
# with the boxes. By unit; a share has none.
LARGEST = {"rad": 0.2, "m": 1.0, "px": 100.0, "": 0.2, "rad/s": 0.1, "s": 1.0}

_DESCRIPTIONS = {
    "mount_pitch": "the camera is pitched by {}",
    "mount_yaw": "the camera is turned sideways by {}",
    "mount_roll": "the camera is rolled by {}",
    "mount_forward": "the camera is {} further forward",
    "mount_left": "the camera is {} further left",
    "mount_up": "the camera is {} higher",
    "focal_length": "the focal length is larger by {}",
    "principal_u": "the principal point is {} further right",
    "principal_v": "the principal point is {} further down",
    "distortion": "the lens has a distortion k1 of {}",
    "odometry_scale": "the steps of the odometry are longer by {}",
    "gyro_bias": "the odometry turns too little to the left, by {}",
    "time_offset": "the images are later than their time stamps by {}",
    "object_size": "objects are larger than their prior size by {}",
}


@dataclass(frozen=True)
class CalibrationFinding:
    """A deviation from the calibration in use, as the boxes show it."""

    name: str
    """Name of the parameter, one of `calibration_parameters`."""
    value: float
    """How far the true value is from the one in use, in ``unit``."""
    sigma: float
    """Standard deviation of ``value``."""
    unit: str
    """Unit of both; empty for a share of the value in use."""
    rivals: tuple[str, ...] = ()
    """Other parameters that would explain the boxes nearly as well."""

    @property
    def sigmas(self) -> float:
        """How many standard deviations the value is from zero."""
        return abs(self.value) / self.sigma

    def __str__(self) -> str:
        """Say it in a sentence, with degrees and percent."""
        scale, unit = {"rad": (180.0 / np.pi, " deg"), "rad/s": (180.0 / np.pi, " deg/s")}.get(
            self.unit, (100.0, " %") if not self.unit else (1.0, f" {self.unit}")
        )
        if self.name == "distortion":
            scale, unit = 1.0, ""
        value = f"{scale * self.value:.3g} ± {scale * self.sigma:.2g}{unit}"
        rest = f" (or {' or '.join(self.rivals)})" if self.rivals else ""
        return f"the boxes say that {_DESCRIPTIONS[self.name].format(value)}{rest}"


def calibration_parameters() -> tuple[str, ...]:
    """Return the names of all parameters that are tested and can be estimated."""
    return tuple(parameter.name for parameter in _core.calibration_parameters())


def parameter_units() -> tuple[str, ...]:
    """Return the unit of each of `calibration_parameters`, empty for a share."""
    return tuple(parameter.unit for parameter in _core.calibration_parameters())


def parameter_rows(given: Sequence[str]) -> list[int]:
    """Return the rows of named parameters among `calibration_parameters`, each once, in order.

    Groups stand for their parameters: ``mount`` for the three rotations of the mount,
    ``mount_position``, ``principal_point``; ``focal`` and ``k1`` are short names.

    Raises
    ------
    ValueError
        For a name that is neither.
    """
    names = calibration_parameters()
    rows: list[int] = []
    for name in given:
        for one in GROUPS.get(name, (name,)):
            if one not in names:
                raise ValueError(
                    f"calibration: no parameter {one!r}, only: {', '.join(names)}; "
                    f"and groups: {', '.join(GROUPS)}"
                )
            if names.index(one) not in rows:
                rows.append(names.index(one))
    return rows
