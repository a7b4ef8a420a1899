"""What is run in each world: the solver with true or default assumptions, or the whole pipeline."""

from typing import Literal, get_args

from dqslam._core import Loss, SolveOptions
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import Assumptions, true_assumptions

RowName = Literal["told", "calibrated", "default", "plain", "run"]
"""The ids are those of the recording in each of them.

told
    `solve` with its default options; it is told the error of the boxes and the spread of the sizes.
calibrated
    As told, and what is wrong with the calibration is estimated: `solve_with_calibration`.
default
    `solve` with all defaults.
plain
    `solve` without a robust loss, the other options and the assumptions by default.
run
    The pipeline, `run`, with all defaults.
"""

ROWS: tuple[RowName, ...] = get_args(RowName)


def possible_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return all rows but those that cannot be: "told", and "calibrated".

    The boxes of cubes and cuboids differ from those of ellipsoids, and not at random, so that there
    are no right sigmas. Where the calibration is right, there is nothing to estimate.
    """
    is_told = scenario.objects == "ellipsoids"
    can_be = {"told": is_told, "calibrated": is_told and bool(wrong_parameters(scenario))}
    return tuple(row for row in ROWS if can_be.get(row, True))


def wrong_parameters(scenario: Scenario) -> tuple[str, ...]:
    """Return the parameters of the calibration that the estimator is given wrongly."""
    given, odometry = scenario.calibration, scenario.odometry
    wrong = {
        "mount_yaw": given.mount_yaw_deg != 0.0,
        "mount_pitch": given.mount_pitch_deg != 0.0,
        "focal_length": given.focal_length_factor != 1.0,
        "time_offset": given.time_offset_s != 0.0,
        "odometry_scale": odometry.scale_error != 0.0,
        "gyro_bias": odometry.gyro_bias_rad_per_s != 0.0,
    }
    return tuple(name for name, is_wrong in wrong.items() if is_wrong)


def usual_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return "told" and "calibrated" where they are possible, and "default"."""
    usual = ("told", "calibrated", "default")
    return tuple(row for row in possible_rows(scenario) if row in usual)


def row_assumptions(row: RowName, scenario: Scenario) -> Assumptions:
    """Return the assumptions about boxes and objects."""
    is_told = row in ("told", "calibrated")
    return true_assumptions(scenario) if is_told else Assumptions()


def row_options(row: RowName) -> SolveOptions:
    """Return the options of the solver."""
    return SolveOptions(loss=Loss.NONE) if row == "plain" else SolveOptions()
