"""Real maps of one place that are turned and shifted at random, and maps of two places."""

from __future__ import annotations

import os
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


def pairs(place: str, draws: int) -> list[str]:
    """Return a row of a table for each pair of robots, and for the loop around all three."""
    maps = [read_landmarks(_FOLDER / place / f"robot{number}.csv") for number in range(3)]
    rows, found = [], {}
    for a, b in PAIRS:
        results, refused = [], 0
        for seed in range(draws):
            motion = draw(seed)
            try:
                alignment = dq.align(maps[a], moved(maps[b], motion))
            except CannotTellError:
                refused += 1
                continue
            results.append(np.linalg.inv(motion) @ alignment.b_from_a)
        if not results:
            rows.append(f"| {place} {a} to {b} | {refused} of {draws} refused | | |")
            continue
        yaws = np.degrees([np.arctan2(one[1, 0], one[0, 0]) for one in results])
        shifts = np.array([one[:2, 3] for one in results])
        found[a, b] = results[0]
        rows.append(
            f"| {place} {a} to {b} | {refused} of {draws} refused | {yaws.mean():.2f} ± "
            f"{np.ptp(yaws):.3f} | {shifts[:, 0].mean():.2f}, {shifts[:, 1].mean():.2f} ± "
            f"{np.ptp(shifts, axis=0).max():.3f} |"
        )
    if len(found) == len(PAIRS):
        loop = np.linalg.inv(found[0, 2]) @ found[1, 2] @ found[0, 1]
        yaw = np.degrees(abs(np.arctan2(loop[1, 0], loop[0, 0])))
        rows.append(f"| {place}, around the loop | | {yaw:.3f} | {np.hypot(*loop[:2, 3]):.3f} |")
    return rows
