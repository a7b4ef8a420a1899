"""Odometry with noise and its covariance."""

from dataclasses import replace

import numpy as np
from numpy.random import Generator, default_rng

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import PoseModel
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Odometry, Recording
from dqslam.simulation.odometry.disturbances import disturb
from dqslam.simulation.path import TruePath
from dqslam.simulation.scenario import OdometrySettings, PlanarOdometrySettings

_UP = [0.0, 0.0, 1.0]


def measure_odometry(
    motion: TruePath,
    settings: OdometrySettings,
    period_s: float,
    random: Generator,
    rare: Generator,
) -> Odometry:
    """Add noise and disturbances to the true motion; return the odometry with its covariance.

    `random` draws the noise, `rare` what the covariance does not know.
    """
    if isinstance(settings, PlanarOdometrySettings):
        odometry = _measure_planar(motion, settings, random)
    else:
        sigmas = np.array([settings.translation_sigma_m, settings.rotation_sigma_rad])
        odometry = _measure_in_space(
            motion.poses[0],
            motion.relative,
            settings.noise_factor * sigmas,
            settings.believed_factor,
            random,
        )
    return disturb(odometry, settings, period_s, rare)


def perturb_odometry(recording: Recording, noise: OdometryNoise, *, seed: int) -> Recording:
    """Add Gaussian noise to every step in SE(3), and have the covariances say so.

    For a recorded trajectory that is better than odometry would be.
    """
    odometry, sigmas = recording.odometry, np.array([noise.translation_m, noise.rotation_rad])
    first_pose, relative = odometry.first_pose, odometry.relative
    noisy = _measure_in_space(first_pose, relative, sigmas, 1.0, default_rng(seed))
    return replace(recording, odometry=noisy)


def _measure_in_space(
    first_pose: Floats, relative: Floats, sigmas: Floats, believed_factor: float, random: Generator
) -> Odometry:
    """Add noise to steps (n, 7); the two sigmas are of each axis, meters and radians."""
    sigma = np.repeat(sigmas, 3)
    error = random.normal(0.0, sigma, size=(len(relative), 6))
    return Odometry(
        PoseModel.SE3,
        first_pose,
        _core.plus(PoseModel.SE3, relative, error),
        np.tile(np.diag((believed_factor * sigma) ** 2), (len(error), 1, 1)),
    )


def _measure_planar(
    motion: TruePath, settings: PlanarOdometrySettings, random: Generator
) -> Odometry:
    """Add noise to (v, omega)."""
    from scipy.spatial.transform import Rotation

    count = len(motion.relative)
    turn_sigma = np.where(
        motion.is_turn, settings.turn_rotation_sigma_rad, settings.rotation_sigma_rad
    )
    sigma = settings.noise_factor * np.column_stack(
        [
            np.full(count, settings.translation_sigma_m),
            np.full(count, settings.lateral_sigma_m),
            turn_sigma,
        ]
    )
    error = sigma * random.normal(size=sigma.shape)
    if not settings.lateral_is_drawn:
        error[:, 1] = 0.0
    measured = motion.relative + error
    believed = settings.believed_factor * sigma
    # The error is along the axes of the previous pose, the covariance along those of the next one.
    next_from_previous = Rotation.from_rotvec(np.outer(-measured[:, 2], _UP)).as_matrix()
    covariance = np.einsum("nij,nj,nkj->nik", next_from_previous, believed**2, next_from_previous)
    return Odometry(PoseModel.SE2, motion.poses[0], measured, covariance)
