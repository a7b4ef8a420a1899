"""What goes wrong with odometry without its covariance's knowing: scale, gyro, slips, jumps."""

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import PoseModel
from dqslam.recording import Odometry
from dqslam.simulation.scenario import JumpSettings, OdometrySettings


def disturb(
    odometry: Odometry, settings: OdometrySettings, period_s: float, random: Generator
) -> Odometry:
    """Return odometry with all disturbances; slips and jumps always draw the same numbers."""
    count = len(odometry.relative)
    for_slips, for_jumps = random.spawn(2)
    relative = odometry.relative
    if settings.scale_error != 0.0:
        relative = _stretched(odometry.pose_model, relative, settings.scale_error, np.ones(count))
    if settings.slips is not None:
        slips = for_slips.random(count) < settings.slips.share
        relative = _stretched(odometry.pose_model, relative, settings.slips.excess, slips)
    if settings.gyro_bias_rad_per_s != 0.0:
        yaw = np.full(count, settings.gyro_bias_rad_per_s * period_s)
        relative = _core.plus(odometry.pose_model, relative, _turn(odometry.pose_model, yaw))
    if settings.jumps is not None:
        error = _jumps(settings.jumps, odometry.pose_model, count, for_jumps)
        relative = _core.plus(odometry.pose_model, relative, error)
    return replace(odometry, relative=relative)


def _stretched(model: PoseModel, relative: Floats, excess: float, where: Floats | Bools) -> Floats:
    """Lengthen the translation of some steps (n,)."""
    axes = 2 if model == PoseModel.SE2 else 3
    factor = 1.0 + excess * np.asarray(where, dtype=np.float64)
    return np.hstack([relative[:, :axes] * factor[:, None], relative[:, axes:]])


def _turn(model: PoseModel, yaw: Floats) -> Floats:
    """Return the tangents of turns about the robot's vertical axis; it is the last coordinate."""
    tangent = np.zeros((len(yaw), 3 if model == PoseModel.SE2 else 6))
    tangent[:, -1] = yaw
    return tangent


def _jumps(jumps: JumpSettings, model: PoseModel, count: int, random: Generator) -> Floats:
    """Return the tangents of all steps, zero where the odometry does not jump."""
    if jumps.count > count:
        raise ValueError(f"odometry.jumps.count: {jumps.count} jumps in {count} steps")
    sizes = (2, 1) if model == PoseModel.SE2 else (3, 3)
    sigma = np.repeat([jumps.translation_sigma_m, jumps.rotation_sigma_rad], sizes)
    tangent = np.zeros((count, len(sigma)))
    steps = random.choice(count, size=jumps.count, replace=False)
    tangent[steps] = random.normal(0.0, sigma, size=(jumps.count, len(sigma)))
    return tangent
