"""Which of the motions is the place, and whether the maps say so: evidence against chance.

The evidence of a motion is the logarithm of its probability over that of no common place, if either
is as likely before, and any motion as likely as any other. By chance it exceeds s once in e^s maps
whose objects are strewn at random. Objects that stand in rows, or in groups that repeat, are not:
there the wrong motions themselves show how much evidence comes without a reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.places.alignment.likelihood import (
    SPREADS,
    Objects,
    Target,
    attribute_ratio,
    evidence,
    log_densities,
    log_student,
    tangent,
)
from dqslam.places.alignment.rigid import MotionModel, Motions

_ROUNDS = 6
_REACH = 3.5  # sigmas of the widest spread within which a partner is looked for
_SCALES = np.log(100.0)  # of scales that are possible before: a tenth to ten
# Runners-up from which the tail of wrong motions is learned, at most the better half of them; fewer
# than the least say too little.
_TAIL, _LEAST_TAIL = 10, 4
_FEWEST_PAIRS = 3
CHANCE = float(np.log(1e2))
"""The evidence that is needed: one map in a hundred has it by chance, and this is a bound."""
RIVAL = float(np.log(1e3))
"""The lead that is needed, see ``lead``."""
_SAME_PAIRS = 0.5


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A motion with what speaks for it."""

    motion: Motions
    """One motion, in a batch of one."""
    partner: Ints
    """Row of B for each object of A, -1 for none, shape (o,)."""
    probability: Floats
    """That the partner is right, shape (o,)."""
    variance: Floats
    """Of one coordinate of the distance of each pair, square meters, shape (o,)."""
    height_variance: float
    """Of the difference of two heights, square meters; NaN if z is like the other axes."""
    evidence: float
    """Natural logarithm."""
    by_class: Floats
    """The part of the evidence that is of the objects of each class, shape (c,)."""

    @property
    def pairs(self) -> Ints:
        """Rows of A and B of the pairs that are more likely right than wrong, shape (p, 2)."""
        rows = np.flatnonzero((self.partner >= 0) & (self.probability > 0.5))
        return np.column_stack([rows, self.partner[rows]])


def judge(a: Objects, target: Target, model: MotionModel, motions: Motions) -> list[Hypothesis]:
    """Fit each motion to the whole maps; return distinct ones, the one with most evidence first."""
    found = [_fit(a, target, model, motions[[row]]) for row in range(len(motions))]
    found.sort(key=lambda one: -one.evidence)
    distinct: list[Hypothesis] = []
    for one in found:
        if len(one.pairs) and not any(_same(one, other) for other in distinct):
            distinct.append(one)
    return distinct


def tail_of(evidences: Floats, possible: Bools) -> Floats:
    """Return by how much evidence grows where one in e of the wrong motions is left.

    ``evidences`` (m, c) are of the runners-up, by class. The tail is the mean excess of the better
    ones over the last of them; 1 is that of chance alone. Classes whose objects stand in rows or
    groups have a longer one. Only runners-up that are ``possible``, (m,), have an excess: how badly
    the others fit says nothing about rows or groups. Shape (c,).
    """
    count = min(_TAIL, len(evidences) // 2)
    if count < _LEAST_TAIL:
        return np.ones(evidences.shape[1])
    last = -np.sort(-evidences, axis=0)[count - 1]
    excess = np.where(possible[:, None], np.maximum(evidences - last, 0.0), 0.0)
    return np.asarray(np.maximum(1.0, excess.sum(axis=0) / (count - 1)))


def lead(found: list[Hypothesis]) -> float:
    """Return by how much the best motion leads, in units of what wrong motions lead by.

    A wrong motion leads by s once in e^s maps. Infinite without a runner-up.
    """
    if len(found) < 2:
        return float("inf")
    others = np.array([one.by_class for one in found[1:]])
    # Chance explains the others better, as clearly as it has to be excluded for the best one.
    possible = np.array([one.evidence > -CHANCE for one in found[1:]])
    ahead = (found[0].by_class - others[0]) / tail_of(others, possible)
    return float(ahead.sum())


def match_again(
    a: Objects, target: Target, motion: Motions, variance: Floats, freedom: float
) -> Ints:
    """Return the pairs (p, 2) that errors of variance (o,) explain better than chance does.

    Errors have Student's distribution of some degrees of freedom, and as many objects are in both
    maps as in one.
    """
    moved = motion.apply(a.centers[None])[0]
    reach = float(np.sqrt(variance.max())) * 2.0 * _REACH
    distance, row = target.nearest(moved, a.labels, reach)
    rows = np.flatnonzero(_one_to_one(distance, row))
    partner, square = row[rows], distance[rows] ** 2
    likely = log_student(square, variance[rows], target.axes, freedom)
    met = likely > np.log(target.background[partner])
    return np.column_stack([rows[met], partner[met]])


def _same(one: Hypothesis, other: Hypothesis) -> bool:
    pairs = one.pairs
    shared = int((other.partner[pairs[:, 0]] == pairs[:, 1]).sum())
    return shared > _SAME_PAIRS * len(pairs)


def doubt(found: list[Hypothesis]) -> str:
    """Return why the best motion may be chance, or another be right; nothing if neither is so."""
    best, ahead = found[0], lead(found)
    if len(best.pairs) < _FEWEST_PAIRS:
        return f"no {_FEWEST_PAIRS} objects of one map lie to each other as in the other map"
    if best.evidence < CHANCE:
        return (
            f"the {len(best.pairs)} objects that agree best may do so by chance (evidence "
            f"{best.evidence:.1f}, {CHANCE:.1f} is needed)"
        )
    if ahead < RIVAL:
        return (
            f"another motion explains the maps nearly as well: {len(found[1].pairs)} objects agree "
            f"about it, {len(best.pairs)} about the best one, whose lead is {ahead:.1f}, where "
            f"{RIVAL:.1f} is needed"
        )
    return ""


def _fit(a: Objects, target: Target, model: MotionModel, motion: Motions) -> Hypothesis:
    """Match and fit in turn, and judge the result."""
    covered = target.covers(motion.apply(a.centers[None])[0])
    for _ in range(_ROUNDS):
        matched = _match(a, target, model, motion, covered)
        weight = matched["probability"] / matched["variance"]
        if (matched["probability"] > 0.5).sum() < 2:
            break
        rows = np.maximum(matched["partner"], 0)
        before = motion
        motion = model.fit(a.centers[None], target.objects.centers[rows][None], weight[None])
        if np.allclose(before.rotation, motion.rotation, atol=1e-9) and np.allclose(
            before.translation, motion.translation, atol=1e-7
        ):
            break
    matched = _match(a, target, model, motion, covered)
    prior = _prior(a, target, model, motion, matched)
    return Hypothesis(
        motion=motion,
        partner=matched["partner"],
        probability=matched["probability"],
        variance=matched["variance"],
        height_variance=matched["height_variance"],
        evidence=matched["log_ratio"] + prior,
        by_class=matched["by_class"],
    )


def _match(
    a: Objects, target: Target, model: MotionModel, motion: Motions, covered: Bools
) -> dict[str, Any]:
    b = target.objects
    moved = motion.apply(a.centers[None])[0]
    widest = np.sqrt(SPREADS[-1] * 2.0 * max(a.variance.max(), b.variance.max()))
    distance, row = target.nearest(moved, a.labels, _REACH * float(widest))
    row = np.where(_one_to_one(distance, row), row, -1)
    met = np.flatnonzero(row >= 0)
    partner = row[met]
    variance = a.variance[met] * motion.scale[0] ** 2 + b.variance[partner]
    log_ratio = np.full((len(SPREADS), len(a)), -np.inf)
    log_ratio[:, met] = log_densities(
        distance[met] ** 2, SPREADS[:, None] * variance, target.axes
    ) - np.log(target.background[partner])
    attributes = np.zeros(len(met))
    size_spread = _spread(a.size, b.size)
    size_variance = a.size_variance[met] + b.size_variance[partner]
    shift = np.log(motion.scale[0])
    attributes += attribute_ratio(a.size[met] + shift - b.size[partner], size_variance, size_spread)
    height_variance = float("nan")
    if model.upright and len(met):
        near = distance[met] ** 2 < 9.0 * variance
        difference = moved[met, 2] - b.centers[partner, 2]
        chosen = difference[near] if near.sum() >= 3 else difference
        middle = float(np.median(chosen))
        spread = 1.4826 * float(np.median(np.abs(chosen - middle)))
        height_variance = max(spread**2, float(SPREADS[0] * variance.mean()))
        attributes += _heights(a, b, met, difference - middle, height_variance)
    log_ratio[:, met] += attributes
    total, probability, terms, spread_row = evidence(log_ratio, covered)
    full = np.full(len(a), np.inf)
    full[met] = SPREADS[spread_row] * variance
    return {
        "partner": row,
        "probability": np.where(row >= 0, probability, 0.0),
        "variance": full,
        "height_variance": height_variance,
        "log_ratio": total,
        "by_class": np.bincount(a.labels, terms, int(a.labels.max()) + 1),
    }


def _heights(a: Objects, b: Objects, met: Ints, difference: Floats, variance: float) -> Floats:
    """Return the log ratios of heights, against those of two objects of the class."""
    ratio = np.zeros(len(met))
    for label in np.unique(a.labels[met]):
        of_class = a.labels[met] == label
        spread = _spread(a.centers[a.labels == label, 2], b.centers[b.labels == label, 2])
        ratio[of_class] = attribute_ratio(difference[of_class], np.array(variance), spread)
    return ratio


def _spread(a: Floats, b: Floats) -> float:
    """Return the variance of the difference of a value of A and one of B; 0 if unknown."""
    known = [values[np.isfinite(values)] for values in (a, b)]
    return float(sum(values.var() for values in known if len(values) > 1))


def _one_to_one(distance: Floats, row: Ints) -> Any:
    """Return whether each object of A is the nearest of those with the same partner, (o,)."""
    order = np.lexsort((distance, row))
    first = np.ones(len(row), dtype=np.bool_)
    first[order[1:]] = row[order[1:]] != row[order[:-1]]
    return first & np.isfinite(distance)


def _prior(
    a: Objects, target: Target, model: MotionModel, motion: Motions, matched: dict[str, Any]
) -> float:
    """Return the log share of all motions that fit as well: what a precise fit has to pay."""
    rows = np.flatnonzero(matched["partner"] >= 0)
    weight = matched["probability"][rows] / matched["variance"][rows]
    places = motion.apply(a.centers[None, rows])[0]
    jacobian = tangent(places - np.average(places, axis=0, weights=weight + 1e-300), model)
    information = np.einsum(
        "o,oij,oik->jk", weight, jacobian[:, : target.axes], jacobian[:, : target.axes]
    )
    columns = [0, 1, 3] if model.upright else [0, 1, 2, 3, 4, 5]
    columns += [jacobian.shape[2] - 1] if model.has_scale else []
    information = information[np.ix_(columns, columns)]
    extents = [np.ptp(x.centers[:, : target.axes], axis=0) for x in (a, target.objects)]
    room = np.log(np.maximum(extents[0] * motion.scale[0] + extents[1], 1e-6)).sum()
    turns = np.log(2.0 * np.pi) if model.upright else np.log(8.0 * np.pi**2)
    volume = room + turns + (_SCALES if model.has_scale else 0.0)
    floor = np.exp(-volume * 2.0 / len(columns)) * np.eye(len(columns))
    _, logdet = np.linalg.slogdet(information / (2.0 * np.pi) + floor)
    return float(min(-0.5 * logdet - volume, 0.0))
