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
    merged_at: tuple[float, float] = (np.nan, np.nan)
    """Mean error of the merged map in the frame of each robot, at the objects of its own map."""
    aligned_m: tuple[float, float] = (np.nan, np.nan)
    """As ``single_m``, after the rigid motion that brings the centers nearest to the true ones."""
    merged_aligned: tuple[float, float] = (np.nan, np.nan)
    """Mean error of the merged map after such a motion, at the objects of each robot's own map."""
    merged_all_aligned: float = np.nan
    """Likewise at all objects."""
    twice: int = 0
    """Objects that both have and that the merged map has twice."""
    wrong: int = 0
    """Objects of both maps that were taken for one, and are two."""


def _landmarks(robot: Robot, folder: Path, *, solves: bool) -> Landmarks:
    graph = robot.graph if solves else None
    dq.save_estimate(robot.estimate, folder, marginals=robot.marginals, graph=graph)
    return read_landmarks(folder)


def run(seed: int, *, solves: bool = True) -> Trial:
    """Merge the maps of two robots; ``solves`` says whether their folders have their problems."""
    a, b = two_robots(seed)
    with tempfile.TemporaryDirectory() as directory:
        return _merge(seed, a, b, Path(directory), solves=solves)


def _merge(seed: int, a: Robot, b: Robot, directory: Path, *, solves: bool) -> Trial:
    maps = [_landmarks(one, directory / str(row), solves=solves) for row, one in enumerate((a, b))]
    single = tuple(float(_errors(one).mean()) for one in (a, b))
    honest = tuple(
        _nees(one.centers - robot.truth.centers[one.object_ids], one.covariances)
        for one, robot in zip(maps, (a, b), strict=True)
    )
    alone = [
        _apart(one.estimate.centers, one.truth.centers[one.estimate.object_ids]) for one in (a, b)
    ]
    nothing = Trial(
        seed,
        "",
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        (single[0], single[1]),
        (honest[0], honest[1]),
        aligned_m=(alone[0], alone[1]),
    )
    try:
        merged = merge(*maps)
    except CannotTellError as error:
        return replace(nothing, refused=str(error))
    found = merged.parts[1].alignment
    assert found is not None
    truth = true_motion(a, b)
    both = a.truth.centers[np.intersect1d(a.estimate.object_ids, b.estimate.object_ids)]
    turn = (found.b_from_a @ np.linalg.inv(truth))[:2, 0]
    apart = both @ (found.b_from_a - truth)[:3, :3].T + (found.b_from_a - truth)[:3, 3]
    true_of: dict[int, int] = {}
    for part in reversed(merged.parts):  # an object of both is that of the first map
        true_of |= dict(zip(part.merged_ids.tolist(), part.object_ids.tolist(), strict=True))
    true_ids = [true_of[one] for one in merged.landmarks.object_ids.tolist()]
    errors = merged.landmarks.centers - a.truth.centers[true_ids]
    ids_of_a = dict(zip(merged.parts[0].merged_ids, merged.parts[0].object_ids, strict=True))
    pairs = [
        (own, ids_of_a[here])
        for own, here in zip(merged.parts[1].object_ids, merged.parts[1].merged_ids, strict=True)
        if here in ids_of_a
    ]
    centers, true_rows = merged.landmarks.centers, np.array(true_ids)
    at, aligned = [], []
    for part, robot in zip(merged.parts, (a, b), strict=True):
        back = np.linalg.inv(part.merged_from_map)
        own = np.isin(merged.landmarks.object_ids, part.merged_ids)
        there = centers[own] @ back[:3, :3].T + back[:3, 3]
        own_truth = robot.truth.centers[true_rows[own]]
        at.append(float(np.linalg.norm(there - own_truth, axis=1).mean()))
        aligned.append(_apart(there, own_truth))
    right = sum(own == other for own, other in pairs)
    common = np.intersect1d(merged.parts[0].object_ids, merged.parts[1].object_ids)
    return replace(
        nothing,
        twice=len(common) - right,
        wrong=len(pairs) - right,
        turn_deg=float(np.degrees(np.arctan2(turn[1], turn[0]))),
        shift_m=float(np.linalg.norm(apart[:, :2], axis=1).mean()),
        nees=_nees(errors, merged.landmarks.covariances),
        merged_m=float(np.linalg.norm(errors, axis=1).mean()),
        merged_at=(at[0], at[1]),
        merged_aligned=(aligned[0], aligned[1]),
        merged_all_aligned=_apart(centers, a.truth.centers[true_rows]),
    )


def _apart(centers: Floats, truth: Floats) -> float:
    """Return the mean error of centers (o, 3) after the best rigid motion."""
    moved = dq.align_rigid(centers, truth).apply(centers)
    return float(np.linalg.norm(moved - truth, axis=1).mean())


def _errors(robot: Robot) -> Floats:
    ids = robot.estimate.object_ids
    error = robot.estimate.centers - robot.truth.centers[ids]
    return np.asarray(np.linalg.norm(error, axis=1))


def _nees(errors: Floats, covariances: Floats) -> float:
    """Return the mean squared error (o, 3) in units of its covariance, divided by 3."""
    solved = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    return float((errors * solved).sum(axis=1).mean() / 3.0)
