"""The motion between two maps, and what speaks for it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._repr import counted
from dqslam.places.alignment.judge import CHANCE, RIVAL

ALIGNMENT_FILE = "alignment.json"


class CannotTellError(ValueError):
    """The maps do not say whether, or how, they are of one place; the message says why."""


@dataclass(frozen=True, eq=False)
class Rival:
    """The next best motion, which takes most of its objects elsewhere."""

    b_from_a: Floats
    """Shape (4, 4)."""
    pairs: int
    """Number of objects that agree about it."""
    evidence: float
    """Natural logarithm, as of the alignment."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """The motion between two maps of one place.

    Examples
    --------
    >>> import dqslam as dq
    >>> found = dq.align("first.csv", "second.csv")
    >>> found.b_from_a.shape, found.covariance.shape
    ((4, 4), (6, 6))
    """

    b_from_a: Floats
    """Takes coordinates of map A into map B, shape (4, 4); its rotation is scaled, if maps are."""
    covariance: Floats
    """Of a small motion in the frame of A, x y z [m] and rotation vector [rad], shape (6, 6).

    0 for roll and pitch if both maps have z up.
    """
    motion: Literal["se2", "se3"]
    """``se2`` is a turn about z and a translation in space, ``se3`` any motion."""
    scale: float
    """Length in B of a meter in A."""
    scale_sigma: float
    """Of the natural logarithm of the scale; 0 if it was assumed to be 1."""
    a_ids: Ints
    """Object of A of each pair, shape (p,)."""
    b_ids: Ints
    """Object of B of each pair, shape (p,)."""
    class_names: tuple[str, ...]
    """Of each pair."""
    distance: Floats
    """Between both objects of a pair, once aligned, meters, shape (p,)."""
    evidence: float
    """Natural logarithm of the odds of this motion against no common place."""
    lead: float
    """By how much it leads the runner-up, in units of what wrong motions lead by; a wrong one
    leads by s once in e^s maps. Infinite without a runner-up."""
    runner_up: Rival | None
    """The next best motion; None if no other takes an object of A to one of B."""
    assumptions: tuple[str, ...] = field(default_factory=tuple)
    """What was taken for granted, a sentence each."""

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.a_ids)

    def __repr__(self) -> str:
        """Show the kind of motion, and how many pairs agree about it."""
        return f"Alignment({self.motion}, {counted(len(self), 'pair')}, {self.rms_m:.2g} m apart)"

    @property
    def rms_m(self) -> float:
        """Root mean square of the distances of the pairs, meters."""
        return float(np.sqrt(np.mean(self.distance**2)))


def describe_alignment(found: Alignment, a: str, b: str) -> dict[str, Any]:
    """Return the content of ``alignment.json``."""
    rival = found.runner_up
    return {
        "a": a,
        "b": b,
        "b_from_a": found.b_from_a,
        "covariance": found.covariance,
        "motion": found.motion,
        "scale": found.scale,
        "log_scale_sigma": found.scale_sigma,
        "rms_m": found.rms_m,
        "evidence": found.evidence,
        "evidence_needed": CHANCE,
        "lead": found.lead,
        "lead_needed": RIVAL,
        "runner_up": None if rival is None else vars(rival),
        "pairs": [
            {"a": one, "b": other, "class_name": name, "distance_m": apart}
            for one, other, name, apart in zip(
                found.a_ids.tolist(),
                found.b_ids.tolist(),
                found.class_names,
                found.distance.tolist(),
                strict=True,
            )
        ],
        "assumptions": found.assumptions,
    }
