"""The true motion of the robot of a scenario."""

from numpy.random import Generator

from dqslam.simulation.path.planar import drive_eight, drive_rectangle, drive_straight
from dqslam.simulation.path.spatial import fly, orbit
from dqslam.simulation.path.true_path import TruePath as TruePath
from dqslam.simulation.path.true_path import poses_later as poses_later
from dqslam.simulation.scenario import (
    FigureOfEightSettings,
    FlightSettings,
    PathSettings,
    RoundedRectangleSettings,
    StraightSettings,
)


def move(path: PathSettings, random: Generator) -> TruePath:
    """Follow a path; only those in space use random numbers."""
    if isinstance(path, RoundedRectangleSettings):
        return drive_rectangle(path)
    if isinstance(path, FigureOfEightSettings):
        return drive_eight(path)
    if isinstance(path, StraightSettings):
        return drive_straight(path)
    if isinstance(path, FlightSettings):
        return fly(path, random)
    return orbit(path, random)
