"""Odometry of a true path: its noise, and what its covariance does not know."""

from dqslam.simulation.odometry.gaps import leave_gaps as leave_gaps
from dqslam.simulation.odometry.measure import measure_odometry as measure_odometry
from dqslam.simulation.odometry.measure import perturb_odometry as perturb_odometry
