"""Motion in space: by hand around a table, and in flight."""

import numpy as np
from numpy.random import Generator

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import PoseModel
from dqslam.simulation.path.true_path import TruePath
from dqslam.simulation.scenario import FlightSettings, OrbitSettings

_WAVES = (0.7, 1.7, 3.1)  # waves of the wobble per turn, so that no two turns are equal
_SAMPLES = 4000  # of an ellipse, to measure its length


def orbit(path: OrbitSettings, random: Generator) -> TruePath:
    """Move around the world's z axis and look at the origin, except for a hand's wobble."""
    turn = np.linspace(0.0, path.turns, path.poses)
    around = 2.0 * np.pi * turn
    distance = path.distance_m + _wobble(turn, path.distance_sigma_m, random)
    height = path.height_m + _wobble(turn, path.height_sigma_m, random)
    if (distance <= 0.0).any():
        raise ValueError("path.distance_sigma_m: the orbit wobbles through its axis")
    roll, pitch, yaw = _angles(path, turn, random)
    position = np.column_stack([distance * np.cos(around), distance * np.sin(around), height])
    # Turn to the axis, tilt down to the origin, roll.
    down = np.arctan2(height, distance)
    return _in_space(position, np.column_stack([around + np.pi + yaw, down + pitch, roll]))


def fly(path: FlightSettings, random: Generator) -> TruePath:
    """Fly around an ellipse in steps of equal length over ground, and look ahead."""
    half_length, half_width = path.length_m / 2.0, path.width_m / 2.0
    sample = np.linspace(0.0, 2.0 * np.pi, _SAMPLES + 1)
    corners = np.column_stack([half_length * np.cos(sample), half_width * np.sin(sample)])
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(corners, axis=0), axis=1).cumsum()])
    steps = max(round(path.laps * along[-1] / path.step_m), 1)
    driven = np.linspace(0.0, path.laps * along[-1], steps + 1)
    lap, rest = np.divmod(driven, along[-1])
    around = np.interp(rest, along, sample) + 2.0 * np.pi * lap
    height = path.height_m + path.climb_m * np.sin(2.0 * around)
    position = np.column_stack([half_length * np.cos(around), half_width * np.sin(around), height])
    forward = np.column_stack([-half_length * np.sin(around), half_width * np.cos(around)])
    slope = 2.0 * path.climb_m * np.cos(2.0 * around) / np.linalg.norm(forward, axis=1)
    roll, pitch, yaw = _angles(path, around / (2.0 * np.pi), random)
    heading = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))
    # Left is the inside of the turn: leaning there lifts the right side.
    bank = -np.deg2rad(path.bank_deg)
    return _in_space(
        position, np.column_stack([heading + yaw, pitch - np.arctan(slope), roll + bank])
    )


def _in_space(position: Floats, angles: Floats) -> TruePath:
    """Return the path with intrinsic rotations yaw, pitch (down), roll; forward is x, left is y."""
    from scipy.spatial.transform import Rotation

    poses = np.hstack([position, Rotation.from_euler("ZYX", angles).as_quat()])
    relative = _core.between(PoseModel.SE3, poses[:-1], poses[1:])
    return TruePath(PoseModel.SE3, poses, relative, np.zeros(len(relative), dtype=np.bool_))


def _angles(
    path: OrbitSettings | FlightSettings, turn: Floats, random: Generator
) -> tuple[Floats, Floats, Floats]:
    """Return the wobble of roll, pitch and yaw, radians."""
    roll, pitch, yaw = (
        np.deg2rad(_wobble(turn, sigma, random))
        for sigma in (path.roll_sigma_deg, path.pitch_sigma_deg, path.yaw_sigma_deg)
    )
    return roll, pitch, yaw


def _wobble(turn: Floats, sigma: float, random: Generator) -> Floats:
    """Return a smooth random deviation: waves of random phase, root mean square about sigma."""
    phases = random.uniform(0.0, 2.0 * np.pi, size=len(_WAVES))
    waves = np.sin(2.0 * np.pi * np.outer(turn, _WAVES) + phases)
    return np.asarray(sigma * np.sqrt(2.0 / len(_WAVES)) * waves.sum(axis=1))
