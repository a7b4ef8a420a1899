"""Real maps of one place that are turned and shifted at random, and maps of two places."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.random import default_rng

import dqslam as dq
from dqslam._checks import Floats
from dqslam.places import CannotTellError, Landmarks, read_landmarks

PLACES = ("parking", "indoor")
PAIRS = ((0, 1), (1, 2), (0, 2))
_FOLDER = Path(os.environ.get("DQSLAM_REALDATA", "../shared/realdata")) / "slideslam_maps"


def moved(landmarks: Landmarks, motion: Floats) -> Landmarks:
    """Return a map in another frame; its centers have no covariances."""
    centers = landmarks.centers @ motion[:3, :3].T + motion[:3, 3]
    return replace(landmarks, centers=np.asarray(centers))


def draw(seed: int) -> Floats:
    """Return a turn about z and a shift of some hundred meters, (4, 4)."""
    random = default_rng(seed)
    yaw, motion = random.uniform(-np.pi, np.pi), np.eye(4)
    motion[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    motion[:3, 3] = random.normal(0.0, 100.0, 3)
    return motion


def rows(place: str, draws: int) -> Iterator[str]:
    """Make a row of a table for each pair of robots, then one for the loop around all three.

    Turn and shift have their means over the draws and, after ±, the range of their changes. Before
    them is how far the worst draw is from the reference that comes with the maps.
    """
    maps = [read_landmarks(_FOLDER / place / f"robot{number}.csv") for number in range(3)]
    found = {}
    for a, b in PAIRS:
        results = [one for one in _aligned(maps[a], maps[b], draws) if one is not None]
        told = f"| {place} {a} to {b} | {draws - len(results)} of {draws} refused |"
        if not results:
            yield f"{told} | | |"
            continue
        yaws = np.degrees([np.arctan2(one[1, 0], one[0, 0]) for one in results])
        shifts = np.array([one[:2, 3] for one in results])
        found[a, b] = results[0]
        yaw, shift = _reference(place, a, b)
        off_deg = np.abs((yaws - yaw + 180.0) % 360.0 - 180.0).max()
        off_m = np.linalg.norm(shifts - shift, axis=1).max()
        yield (
            f"{told} {off_deg:.2f} deg, {off_m:.3f} m | {yaws.mean():.2f} ± {np.ptp(yaws):.3f} | "
            f"{shifts[:, 0].mean():.2f}, {shifts[:, 1].mean():.2f} ± "
            f"{np.ptp(shifts, axis=0).max():.3f} |"
        )
    if len(found) == len(PAIRS):
        loop = np.linalg.inv(found[0, 2]) @ found[1, 2] @ found[0, 1]
        yaw = np.degrees(abs(np.arctan2(loop[1, 0], loop[0, 0])))
        yield f"| {place}, around the loop | | | {yaw:.3f} | {np.hypot(*loop[:2, 3]):.3f} |"


def _aligned(a: Landmarks, b: Landmarks, draws: int) -> Iterator[Floats | None]:
    """Align A with B in a frame of each draw; return b_from_a (4, 4), or None if refused."""
    for seed in range(draws):
        motion = draw(seed)
        try:
            yield np.linalg.inv(motion) @ dq.align(a, moved(b, motion)).b_from_a
        except CannotTellError:
            yield None


def _reference(place: str, a: int, b: int) -> tuple[float, Floats]:
    """Return the turn [deg] and the shift (2,) [m] that come with the maps."""
    with open(_FOLDER / place / "reference_alignment.csv", encoding="utf-8") as file:
        lines = csv.DictReader(line for line in file if not line.startswith("#"))
        row = next(one for one in lines if one["from"] == str(a) and one["to"] == str(b))
    return float(row["yaw_deg"]), np.array([float(row["tx"]), float(row["ty"])])
