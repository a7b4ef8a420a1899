"""Drives on the plane z = 0: in each step v forward, then a turn by omega."""

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import PoseModel
from dqslam.simulation.path.true_path import TruePath
from dqslam.simulation.scenario import (
    FigureOfEightSettings,
    RoundedRectangleSettings,
    StraightSettings,
)


def drive_rectangle(path: RoundedRectangleSettings) -> TruePath:
    """Drive around a rounded rectangle.

    Straight parts have the whole number of steps for which the rectangle is nearest to its size.
    """
    turn = np.full(path.turn_steps, np.pi / 2.0 / path.turn_steps)
    heading = np.cumsum(turn) - turn
    along_sides = path.step_m * (np.cos(heading).sum() + np.sin(heading).sum())
    straight = [round((side - along_sides) / path.step_m) for side in (path.length_m, path.width_m)]
    if min(straight) < 0:
        raise ValueError("path: the rectangle is too small for its turns")
    half_lap = np.concatenate([np.zeros(straight[0]), turn, np.zeros(straight[1]), turn])
    from_corner = np.tile(half_lap, 2 * path.laps)
    omega = np.roll(from_corner, -round(path.start_fraction * straight[0]))
    return _drive(path.step_m, omega)


def drive_eight(path: FigureOfEightSettings) -> TruePath:
    """Drive two circles that touch; both close exactly, as polygons."""
    steps = max(round(2.0 * np.pi * path.radius_m / path.step_m), 3)
    turn = np.full(steps, 2.0 * np.pi / steps)
    # The corners of a regular polygon with this side are on the circle.
    side = 2.0 * path.radius_m * np.sin(np.pi / steps)
    return _drive(side, np.tile(np.concatenate([turn, -turn]), path.laps))


def drive_straight(path: StraightSettings) -> TruePath:
    """Drive straight ahead, the whole number of steps that is nearest to the length."""
    return _drive(path.step_m, np.zeros(max(round(path.length_m / path.step_m), 1)))


def _drive(step_m: float, omega: Floats) -> TruePath:
    relative = np.column_stack([np.full(len(omega), step_m), np.zeros(len(omega)), omega])
    poses = _core.dead_reckon(PoseModel.SE2, np.zeros(3), relative)
    return TruePath(PoseModel.SE2, poses, relative, omega != 0.0)
