"""Simulated worlds: scenarios, the paths, odometry and boxes in them, and their truth."""

from dqslam.simulation.odometry import perturb_odometry as perturb_odometry
from dqslam.simulation.scenario import Scenario as Scenario
from dqslam.simulation.scenario import load_scenario as load_scenario
from dqslam.simulation.simulator import simulate as simulate
