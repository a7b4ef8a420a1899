"""Where objects are, by rules for their classes: on planes, on and beside each other, upright."""

from dqslam.placements.solve import Placements as Placements
from dqslam.placements.solve import SupportPlane as SupportPlane
from dqslam.placements.solve import placed_covariances as placed_covariances
from dqslam.placements.solve import solve_with_placements as solve_with_placements
from dqslam.placements.up import UpDirection as UpDirection
