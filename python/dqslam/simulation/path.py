"""The motion of the robot of a scenario, and its odometry."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator, default_rng

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import PoseModel
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Odometry, Recording
from dqslam.simulation.scenario import (
    OdometrySettings,
    OrbitSettings,
    PathSettings,
    PlanarOdometrySettings,
    RoundedRectangleSettings,
)

_UP = [0.0, 0.0, 1.0]
_WAVES = (0.7, 1.7, 3.1)  # waves of the wobble per turn, so that no two turns are equal


class TruePath(NamedTuple):
    """The true path; d is the pose size."""

    pose_model: PoseModel
    poses: Floats  # world_from_robot, (n, d)
    relative: Floats  # next_in_previous, (n - 1, d)
    is_turn: Bools  # whether a step turns, if the noise of odometry depends on it; (n - 1,)


def move(path: PathSettings, random: Generator) -> TruePath:
    """Follow a path; only a hand-held one uses random numbers."""
    if isinstance(path, RoundedRectangleSettings):
        return _drive(path)
    return _orbit(path, random)


def _drive(path: RoundedRectangleSettings) -> TruePath:
    """Drive by (v, 0, omega) in each step: v forward, then a turn by omega.

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
    relative = np.column_stack([np.full(len(omega), path.step_m), np.zeros(len(omega)), omega])
    poses = _core.dead_reckon(PoseModel.SE2, np.zeros(3), relative)
    return TruePath(PoseModel.SE2, poses, relative, omega != 0.0)


def _orbit(path: OrbitSettings, random: Generator) -> TruePath:
    """Move around the world's z axis and look at the origin, except for a hand's wobble."""
    from scipy.spatial.transform import Rotation

    turn = np.linspace(0.0, path.turns, path.poses)
    around = 2.0 * np.pi * turn
    distance = path.distance_m + _wobble(turn, path.distance_sigma_m, random)
    height = path.height_m + _wobble(turn, path.height_sigma_m, random)
    if (distance <= 0.0).any():
        raise ValueError("path.distance_sigma_m: the orbit wobbles through its axis")
    roll, pitch, yaw = (
        np.deg2rad(_wobble(turn, sigma, random))
        for sigma in (path.roll_sigma_deg, path.pitch_sigma_deg, path.yaw_sigma_deg)
    )
    position = np.column_stack([distance * np.cos(around), distance * np.sin(around), height])
    # Intrinsic rotations: turn to the axis, tilt down to the origin, roll. Forward is x, left is y.
    down = np.arctan2(height, distance)
    angles = np.column_stack([around + np.pi + yaw, down + pitch, roll])
    poses = np.hstack([position, Rotation.from_euler("ZYX", angles).as_quat()])
    relative = _core.between(PoseModel.SE3, poses[:-1], poses[1:])
    return TruePath(PoseModel.SE3, poses, relative, np.zeros(len(relative), dtype=np.bool_))


def _wobble(turn: Floats, sigma: float, random: Generator) -> Floats:
    """Return a smooth random deviation: waves of random phase, root mean square about sigma."""
    phases = random.uniform(0.0, 2.0 * np.pi, size=len(_WAVES))
    waves = np.sin(2.0 * np.pi * np.outer(turn, _WAVES) + phases)
    return np.asarray(sigma * np.sqrt(2.0 / len(_WAVES)) * waves.sum(axis=1))


def measure_odometry(motion: TruePath, noise: OdometrySettings, random: Generator) -> Odometry:
    """Add noise to the true motion; return the odometry with its covariance."""
    if isinstance(noise, PlanarOdometrySettings):
        return _measure_planar(motion, noise, random)
    sigmas = (noise.translation_sigma_m, noise.rotation_sigma_rad)
    return _measure_in_space(motion.poses[0], motion.relative, sigmas, random)


def perturb_odometry(recording: Recording, noise: OdometryNoise, *, seed: int) -> Recording:
    """Add Gaussian noise to every step in SE(3), and have the covariances say so.

    For a recorded trajectory that is better than odometry would be.
    """
    odometry, sigmas = recording.odometry, (noise.translation_m, noise.rotation_rad)
    noisy = _measure_in_space(odometry.first_pose, odometry.relative, sigmas, default_rng(seed))
    return replace(recording, odometry=noisy)


def _measure_in_space(
    first_pose: Floats, relative: Floats, sigmas: tuple[float, float], random: Generator
) -> Odometry:
    """Add noise to steps (n, 7); the sigmas are of each axis, meters and radians."""
    sigma = np.repeat(sigmas, 3)
    error = random.normal(0.0, sigma, size=(len(relative), 6))
    return Odometry(
        PoseModel.SE3,
        first_pose,
        _core.plus(PoseModel.SE3, relative, error),
        np.tile(np.diag(sigma**2), (len(error), 1, 1)),
    )


def _measure_planar(motion: TruePath, noise: PlanarOdometrySettings, random: Generator) -> Odometry:
    """Add noise to (v, omega)."""
    from scipy.spatial.transform import Rotation

    count = len(motion.relative)
    turn_sigma = np.where(motion.is_turn, noise.turn_rotation_sigma_rad, noise.rotation_sigma_rad)
    sigma = np.column_stack(
        [
            np.full(count, noise.translation_sigma_m),
            np.full(count, noise.lateral_sigma_m),
            turn_sigma,
        ]
    )
    error = sigma * random.normal(size=sigma.shape)
    if not noise.lateral_is_drawn:
        error[:, 1] = 0.0
    measured = motion.relative + error
    # The error is along the axes of the previous pose, the covariance along those of the next one.
    next_from_previous = Rotation.from_rotvec(np.outer(-measured[:, 2], _UP)).as_matrix()
    covariance = np.einsum("nij,nj,nkj->nik", next_from_previous, sigma**2, next_from_previous)
    return Odometry(PoseModel.SE2, motion.poses[0], measured, covariance)
