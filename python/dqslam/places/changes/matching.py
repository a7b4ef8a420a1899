"""Which objects of two maps are the same, at their place or moved, with probabilities.

Each object of the first map stayed, moved, vanished, or is still there and was not mapped again;
each of the second is one of these, appeared, or was there before and was not mapped. The prior
probabilities are stated below. The places of both maps, the sizes and classes, and how often the
cameras looked give the likelihood; the assignment with the largest product is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.places.changes.seen_map import SeenMap, missed
from dqslam.places.changes.sizes import SizeErrors, learned_errors, log_size_ratio, usual_errors

# Prior probabilities: an object stays, moves, vanishes; one of the second map is new.
STAYS, MOVES, VANISHES, APPEARS = 0.7, 0.1, 0.1, 0.1
# Error of a center that covariances do not show, as a share of the mean semi-axis, and meters.
CENTER_SHARE, CENTER_M = 0.3, 0.01
# Displacements of moved objects: sigma [m], and the share that is moved anywhere.
MOVED_M, ANYWHERE = 0.8, 0.005
# The share of objects that stay on what they stand on, and the sigmas of heights [m]: theirs,
# beside the covariance, and that of the others.
ON_SURFACE, SURFACE_M, OTHER_SURFACE_M = 0.85, 0.03, 0.4
# An object that stayed with at least this probability shows how well sizes are repeated.
CERTAIN = 0.95
# Probability of another class for the same object, if no boxes show how often that happens.
CONFUSED = 0.02
# Share of objects within another of their class that are two things, such as a bowl in a bowl.
DOUBLED = 0.5
# Share of errors of stayed objects that are larger, and how many times.
WIDE_SHARE, WIDER = 0.03, 2.5


@dataclass(frozen=True, eq=False)
class Assignment:
    """Rows of both maps that are the same object, and probabilities."""

    second: Ints
    """Row in the second map of each object of the first, -1 for none; shape (a,)."""
    stayed: Floats
    """Probability that each object of the first map stayed where it was, shape (a,)."""
    moved: Floats
    """That it moved to where its match is, shape (a,); 0 without a match."""
    vanished: Floats
    """That it is not at its place any more, and is no object of the second map, shape (a,)."""
    appeared: Floats
    """That each object of the second map was not there before, shape (b,)."""


def match_maps(
    first: SeenMap, second: SeenMap, looks_in_second: Floats, looks_in_first: Floats
) -> Assignment:
    """Match two maps in one frame.

    ``looks_in_second`` (a,) are the boxes that objects of the first map should have had in the
    second, ``looks_in_first`` (b,) likewise.
    """
    errors = usual_errors(first, second)
    found = _match(first, second, errors, looks_in_second, looks_in_first)
    rows = np.flatnonzero((found.second >= 0) & (found.stayed > CERTAIN))
    certain = np.column_stack([rows, found.second[rows]])
    errors = learned_errors(first, second, certain, errors)
    found = _match(first, second, errors, looks_in_second, looks_in_first)
    return _without_doubles(first, second, found)


def _without_doubles(first: SeenMap, second: SeenMap, found: Assignment) -> Assignment:
    """Doubt that objects within others of their class, which both maps have, vanished or appeared.

    One map may have one thing twice, and the other once.
    """
    matched = found.second >= 0
    known = np.zeros(len(second), dtype=np.bool_)
    known[found.second[matched]] = True
    doubled = (first.within_each_other() & matched).any(axis=1)
    doubled_later = (second.within_each_other() & known).any(axis=1)
    return replace(
        found,
        vanished=np.where(doubled, DOUBLED, 1.0) * found.vanished,
        appeared=np.where(doubled_later, DOUBLED, 1.0) * found.appeared,
    )


def _match(
    first: SeenMap,
    second: SeenMap,
    errors: SizeErrors,
    looks_in_second: Floats,
    looks_in_first: Floats,
) -> Assignment:
    from scipy.optimize import linear_sum_assignment

    stay, move = _log_same(first, second, errors)
    unseen = missed(looks_in_second)
    unseen_before = missed(looks_in_first)
    extent = np.ptp(np.vstack([first.centers, second.centers]), axis=0) + 1.0
    log_volume = float(np.log(extent.prod()))
    stay = stay + np.log(STAYS)
    move = move + np.log(MOVES)
    alone = np.log(VANISHES + MOVES * unseen_mean(unseen) + STAYS * unseen)
    # As many objects as the second map has may be new, anywhere in the place.
    new = np.log(APPEARS + STAYS * unseen_before) + np.log(len(second)) - log_volume
    gain = np.maximum(stay, move) - alone[:, None] - new[None, :]
    rows, columns = linear_sum_assignment(np.maximum(gain, 0.0), maximize=True)
    match = np.full(len(first), -1)
    good = gain[rows, columns] > 0.0
    match[rows[good]] = columns[good]
    return _probabilities(match, stay, move, alone, new, unseen, unseen_before)


def unseen_mean(unseen: Floats) -> float:
    """Return the mean probability that an object is not mapped, wherever it is now."""
    return float(unseen.mean()) if len(unseen) else 1.0


def _probabilities(
    match: Ints,
    stay: Floats,
    move: Floats,
    alone: Floats,
    new: Floats,
    unseen: Floats,
    unseen_before: Floats,
) -> Assignment:
    gone = (VANISHES + MOVES * unseen_mean(unseen)) / np.exp(alone)
    appeared = APPEARS / (APPEARS + STAYS * unseen_before)
    stayed, moved = 1.0 - gone, np.zeros(len(match))
    vanished = gone.copy()
    for row in np.flatnonzero(match >= 0).tolist():
        column = match[row]
        logs = np.array([stay[row, column], move[row, column], alone[row] + new[column]])
        share = np.exp(logs - logs.max())
        share /= share.sum()
        stayed[row] = share[0] + share[2] * (1.0 - gone[row])
        moved[row], vanished[row] = share[1], share[2] * gone[row]
        appeared[column] *= share[2]
    return Assignment(match, stayed, moved, vanished, appeared)


def _log_same(first: SeenMap, second: SeenMap, errors: SizeErrors) -> tuple[Floats, Floats]:
    """Return log densities of the second map's place and size of an object: stayed, moved.

    Relative to the density of sizes of the class; shape (a, b).
    """
    difference = second.centers[None] - first.centers[:, None]
    total = first.center_covariances[:, None] + second.center_covariances[None]
    own = np.exp(first.log_size[:, 0])
    total = total + ((CENTER_SHARE * own) ** 2 + CENTER_M**2)[:, None, None, None] * np.eye(3)
    chi2 = np.einsum("abi,abij,abj->ab", difference, np.linalg.inv(total), difference)
    peak = -0.5 * np.linalg.slogdet(2.0 * np.pi * total)[1]
    stay = np.logaddexp(
        np.log1p(-WIDE_SHARE) + peak - 0.5 * chi2,
        np.log(WIDE_SHARE / WIDER**3) + peak - 0.5 * chi2 / WIDER**2,
    )
    near = _log_displacement(difference, total, second.up)
    extent = np.ptp(np.vstack([first.centers, second.centers]), axis=0) + 1.0
    anywhere = np.log(ANYWHERE) - np.log(extent.prod())
    move = np.logaddexp(np.log1p(-ANYWHERE) + near, anywhere)
    size = log_size_ratio(first, second, errors)
    labels = _log_class(first, second)
    return stay + size + labels, move + size + labels


def _log_displacement(difference: Floats, covariance: Floats, up: Floats | None) -> Floats:
    """Return the log density of displacements (a, b, 3) of moved objects, shape (a, b).

    ``covariance`` (a, b, 3, 3) is that of the errors of both places. Without ``up`` (3,), heights
    are as any direction.
    """
    square = (difference**2).sum(axis=2)
    if up is None:
        return np.asarray(-0.5 * square / MOVED_M**2 - 1.5 * np.log(2.0 * np.pi * MOVED_M**2))
    rise, variance = difference @ up, np.einsum("abij,i,j->ab", covariance, up, up)
    along = -0.5 * (square - rise**2) / MOVED_M**2 - np.log(2.0 * np.pi * MOVED_M**2)
    parts = []
    for share, sigma in ((ON_SURFACE, SURFACE_M), (1.0 - ON_SURFACE, OTHER_SURFACE_M)):
        both = variance + sigma**2
        parts.append(np.log(share) - 0.5 * rise**2 / both - 0.5 * np.log(2.0 * np.pi * both))
    return np.asarray(along + np.logaddexp(*parts))


def _log_class(first: SeenMap, second: SeenMap) -> Floats:
    """Return how much more likely the classes of two objects are if they are the same, (a, b)."""
    names = sorted(set(first.class_names) | set(second.class_names))
    a = np.array([names.index(name) for name in first.class_names], dtype=np.int64)
    b = np.array([names.index(name) for name in second.class_names], dtype=np.int64)
    share = (np.bincount(b, minlength=len(names)) + 1.0) / (len(b) + len(names))
    same = np.where(a[:, None] == b[None, :], 1.0 - CONFUSED, CONFUSED / max(len(names) - 1, 1))
    if first.sensor is not None:
        # An object whose boxes had several labels may get any of these as its class.
        column = {name: number for number, name in enumerate(first.sensor.labels)}
        for number, name in enumerate(names):
            if name in column:
                own = np.exp(first.sensor.log_label[:, column[name]])
                same[:, b == number] = np.maximum(same[:, b == number], own[:, None])
    return np.asarray(np.log(same) - np.log(share[b])[None, :])
