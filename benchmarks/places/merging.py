"""Merged maps of two robots: found, right, honest, and better than one map alone."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
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
    single_nees: tuple[float, float]
    """NEES of the centers of each map alone, divided by 3."""


def _landmarks(robot: Robot, folder: Path) -> Landmarks:
    dq.save_estimate(robot.estimate, folder, marginals=robot.marginals)
    return read_landmarks(folder)


def run(seed: int) -> Trial:
    """Merge the maps of two robots."""
    a, b = two_robots(seed)
    with tempfile.TemporaryDirectory() as directory:
        maps = [_landmarks(one, Path(directory) / str(row)) for row, one in enumerate((a, b))]
    single = tuple(float(_errors(one).mean()) for one in (a, b))
    honest = tuple(
        _nees(one.centers - robot.truth.center[one.object_ids], one.covariances)
        for one, robot in zip(maps, (a, b), strict=True)
    )
    nothing = Trial(
        seed, "", np.nan, np.nan, np.nan, np.nan, (single[0], single[1]), (honest[0], honest[1])
    )
    try:
        merged = merge(*maps)
    except CannotTellError as error:
        return replace(nothing, refused=str(error))
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
    return replace(
        nothing,
        turn_deg=float(np.degrees(np.arctan2(turn[1], turn[0]))),
        shift_m=float(np.linalg.norm(apart[:, :2], axis=1).mean()),
        nees=_nees(errors, merged.landmarks.covariances),
        merged_m=float(np.linalg.norm(errors, axis=1).mean()),
    )


def _errors(robot: Robot) -> Floats:
    ids = robot.estimate.object_ids
    error = robot.estimate.centers - robot.truth.center[ids]
    return np.asarray(np.linalg.norm(error, axis=1))


def _nees(errors: Floats, covariances: Floats) -> float:
    """Return the mean squared error (o, 3) in units of its covariance, divided by 3."""
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    return float((errors * solved).sum(axis=1).mean() / 3.0)
