"""Merged maps of two robots: found, right, honest, and better than one map alone."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import dqslam as dq
from benchmarks.places.robots import Robot, true_motion, two_robots
from dqslam._checks import Floats
from dqslam.places import CannotTellError, Landmarks, merge, read_landmarks


@dataclass(frozen=True)
class Trial:
    """One pair of robots."""

    seed: int
    refused: str
    """Why the maps were not aligned, or nothing."""
    turn_deg: float
    """Error of the turn between the frames of the robots."""
    shift_m: float
    """Mean error of the motion at the objects that both have."""
    nees: float
    """Of the merged centers, divided by 3, with their covariances; its expectation is 1."""
    merged_m: float
    """Mean error of the merged centers, in the frame of the first robot."""
    single_m: tuple[float, float]
    """Mean error of each map alone, in its own frame."""


def _landmarks(robot: Robot, folder: Path) -> Landmarks:
    dq.save_estimate(robot.estimate, folder, marginals=robot.marginals)
    return read_landmarks(folder)


def run(seed: int) -> Trial:
    """Merge the maps of two robots."""
    a, b = two_robots(seed)
    with tempfile.TemporaryDirectory() as directory:
        maps = [_landmarks(one, Path(directory) / str(row)) for row, one in enumerate((a, b))]
    single = tuple(float(_errors(one).mean()) for one in (a, b))
    nothing = Trial(seed, "", np.nan, np.nan, np.nan, np.nan, (single[0], single[1]))
    try:
        merged = merge(*maps)
    except CannotTellError as error:
        return Trial(**vars(nothing) | {"refused": str(error)})
    found = merged.parts[1].alignment
    assert found is not None
    truth = true_motion(a, b)
    both = a.truth.center[np.intersect1d(a.estimate.object_ids, b.estimate.object_ids)]
    turn = (found.b_from_a @ np.linalg.inv(truth))[:2, 0]
    apart = both @ (found.b_from_a - truth)[:3, :3].T + (found.b_from_a - truth)[:3, 3]
    true_ids = np.concatenate(
        [maps[0].object_ids, np.full(len(merged.landmarks) - len(maps[0]), -1)]
    )
    alone = merged.parts[1].merged_ids
    rows = np.searchsorted(merged.landmarks.object_ids, alone)
    new = rows >= len(maps[0])
    true_ids[rows[new]] = maps[1].object_ids[new]
    errors = merged.landmarks.centers - a.truth.center[true_ids]
    inverse = np.linalg.inv(merged.landmarks.covariances)
    squares = np.einsum("oi,oij,oj->o", errors, inverse, errors) / 3.0
    return Trial(
        seed=seed,
        refused="",
        turn_deg=float(np.degrees(np.arctan2(turn[1], turn[0]))),
        shift_m=float(np.linalg.norm(apart[:, :2], axis=1).mean()),
        nees=float(squares.mean()),
        merged_m=float(np.linalg.norm(errors, axis=1).mean()),
        single_m=(single[0], single[1]),
    )


def _errors(robot: Robot) -> Floats:
    ids = robot.estimate.object_ids
    error = robot.estimate.centers - robot.truth.center[ids]
    return np.asarray(np.linalg.norm(error, axis=1))
