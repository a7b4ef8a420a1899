"""How the frames of two maps lie to each other, if nobody says so: they are one, or aligned."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.io import Results
from dqslam.places.alignment.consensus import align
from dqslam.places.alignment.judge import CHANCE
from dqslam.places.alignment.result import CannotTellError
from dqslam.places.changes.seen_map import SeenMap

# Error of the frames of two maps that are said to have one: meters and radians.
FRAME_SIGMA_M, FRAME_SIGMA_RAD = 0.05, 0.02
# Objects nearer than so many sigmas are at one place.
_AT_ONE_PLACE = 3.0
# Where this share of the smaller map is at its place, no other motion is looked for.
_MOST_STAY = 0.5


def frame_covariance() -> Floats:
    """Return the covariance of the frames of two maps that are said to have one, (6, 6)."""
    return np.diag([FRAME_SIGMA_M**2] * 3 + [FRAME_SIGMA_RAD**2] * 3)


def find_frame(
    first: Results, second: Results, one: SeenMap, other: SeenMap
) -> tuple[Floats, Floats, str]:
    """Return second_from_first (4, 4), its covariance in the second frame (6, 6), and a sentence.

    ``one`` and ``other`` are both maps as they are, the first with the error of one frame.

    Raises
    ------
    CannotTellError
        If the objects agree about neither one frame nor a motion.
    """
    hits, evidence = one_frame_evidence(one, other)
    smaller = min(len(one), len(other))
    same = np.eye(4), frame_covariance(), f"one frame: {hits} objects are at one place in both maps"
    if evidence > CHANCE and hits >= _MOST_STAY * smaller:
        return same
    try:
        found = align(first, second)
    except CannotTellError as error:
        if evidence > CHANCE:
            return same
        raise CannotTellError(
            f"in one frame, {hits} of {smaller} objects would be at one place, as by chance; and "
            f"they cannot be aligned: {error}"
        ) from None
    told = f"aligned by {len(found)} objects: in one frame, {hits} of {smaller} would be in place"
    return found.b_from_a, covariance_in_b(found.b_from_a, found.covariance), told


def one_frame_evidence(one: SeenMap, other: SeenMap) -> tuple[int, float]:
    """Count objects of one map at the place of one of their class in the other, in one frame.

    Also return how much that says against chance: minus the logarithm of Chernoff's bound on the
    probability that so many strewn objects are there. Heights are left out: where all stands on one
    floor, they agree in any frame.
    """
    from scipy.spatial import cKDTree

    blur = np.trace(one.center_covariances, axis1=1, axis2=2) / 3.0
    blur = blur + np.median(np.trace(other.center_covariances, axis1=1, axis2=2)) / 3.0
    gate = _AT_ONE_PLACE * np.sqrt(blur)
    # The area of the place: of the two directions in which it is widest.
    spread = other.centers - other.centers.mean(axis=0)
    axes = np.linalg.svd(spread, full_matrices=False)[2]
    area = float(np.sort(np.ptp(spread @ axes.T, axis=0))[-2:].prod())
    names, others = np.array(one.class_names), np.array(other.class_names)
    hits, expected = 0, 0.0
    for name in np.intersect1d(names, others).tolist():
        own, there = np.flatnonzero(names == name), np.flatnonzero(others == name)
        distance, _ = cKDTree(other.centers[there]).query(one.centers[own])
        hits += int(np.sum(distance < gate[own]))
        around = len(there) * np.pi * gate[own] ** 2
        expected += float(np.minimum(around / max(area, 1e-12), 1.0).sum())
    if hits <= expected:
        return hits, 0.0
    return hits, hits * float(np.log(hits / expected)) - hits + expected


def covariance_in_b(b_from_a: Floats, covariance: Floats) -> Floats:
    """Return the covariance (6, 6) of a small motion in the frame of A as one in that of B.

    Roll and pitch, which are taken to be exact where z is up in both maps, get the error of the
    frames: two maps are never that upright.
    """
    full = np.array(covariance, dtype=np.float64)
    for axis in (3, 4):
        if full[axis, axis] == 0.0:
            full[axis, axis] = FRAME_SIGMA_RAD**2
    turn, (x, y, z) = b_from_a[:3, :3], b_from_a[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = turn
    adjoint[:3, 3:] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ turn
    return np.asarray(adjoint @ full @ adjoint.T)
