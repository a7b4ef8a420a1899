"""Horizontal planes that several objects stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints

# A plane of fewer objects is a coincidence.
FEWEST_OBJECTS = 3
# An object may stand on a plane if its lowest point is this many sigmas from it at most.
GATE = 3.0


@dataclass(frozen=True)
class FoundPlane:
    """A plane before the estimate."""

    height: float
    """Meters along the direction up."""
    rows: Ints
    """The objects on it."""


def find_planes(heights: Floats, sigmas: Floats, several: bool) -> list[FoundPlane]:
    """Return the planes that most objects can stand on, that with most objects first.

    Parameters
    ----------
    heights, sigmas
        The lowest points of the objects along the direction up, and their uncertainty, meters,
        shapes (n,).
    several
        Whether objects that are not on the first plane may be on another one. Otherwise the one
        plane needs no fewest number of objects.
    """
    left = np.isfinite(heights) & np.isfinite(sigmas)
    planes: list[FoundPlane] = []
    fewest = FEWEST_OBJECTS if several else 1
    while left.sum() >= fewest and (several or not planes):
        height, on_it = _largest(heights, sigmas, left)
        if on_it.sum() < fewest:
            break
        planes.append(FoundPlane(height, np.flatnonzero(on_it)))
        left &= ~on_it
    return planes


def _largest(heights: Floats, sigmas: Floats, left: Bools) -> tuple[float, Bools]:
    """Return the height at which most objects stand, with least chi-square, and these objects."""
    best, score = left, (-1, 0.0)
    for candidate in heights[left]:
        squares = ((heights - candidate) / sigmas) ** 2
        on_it = left & (squares <= GATE**2)
        reached = (int(on_it.sum()), -float(squares[on_it].sum()))
        if reached > score:
            best, score = on_it, reached
    weights = 1.0 / sigmas[best] ** 2
    return float(np.average(heights[best], weights=weights)), best
