"""Objects in the map whose size or shape is not to be believed, by what the others are like."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.assumptions import SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.uncertainty import Marginals

# A class says what is usual once an object has so many others of it, and else the map does ...
MIN_OTHERS_OF_CLASS, MIN_OTHERS = 3, 5
# ... whose logarithms spread by at least this; a few that agree show less by chance. An axis is
# then odd that is 2.1 times the usual one of its class, or 4.5 times that of the map.
LEAST_SPREAD_OF_CLASS, LEAST_SPREAD = 0.25, 0.5
# An axis is odd that is further from the usual one, in spreads of the logarithm.
MOST_SPREADS = 3.0
# Its boxes leave an axis open that is off by fewer of its own standard deviations.
OPEN_SIGMAS = 3.0
_AXES = ("longest", "middle", "shortest")

Usual = tuple[Floats, Floats, str]
"""Logarithms of usual semi-axes, descending, their spread, (3,) each, and whose they are."""


def find_doubtful(
    estimate: Estimate, prior: SizePrior | SizePriors, marginals: Marginals | None
) -> dict[int, str]:
    """Return ids of objects with an axis that is far from those of others, and a sentence on each.

    It is compared with the other objects of its class; if these are few, with the prior of its
    class; if it has none, with the other objects of the map, or if these are few, with the prior of
    all sizes. An object is not judged by its own size, however many boxes it has.
    """
    logs = np.log(estimate.semi_axes)
    sigmas = _log_sigmas(estimate, marginals)
    names = np.array(estimate.class_names, dtype=object)
    known = np.isfinite(logs).all(axis=1)

    def usual_of(row: int) -> Usual:
        others = known & (np.arange(len(logs)) != row)
        alike = others & (names == names[row])
        if alike.sum() >= MIN_OTHERS_OF_CLASS:
            what = f"of its class, by the {alike.sum()} others"
            return *_usual(logs[alike], LEAST_SPREAD_OF_CLASS), what
        has_prior = isinstance(prior, SizePriors) and names[row] in prior.classes
        if others.sum() >= MIN_OTHERS and not has_prior:
            what = f"in this map, by the {others.sum()} other objects"
            return *_usual(logs[others], LEAST_SPREAD), what
        expected = prior.of(estimate.class_names[row])
        spread = np.full(3, expected.log_sigma)
        return np.full(3, expected.log_mean), spread, "by the prior of its size"

    found: dict[int, str] = {}
    for row in np.flatnonzero(known).tolist():
        why = _why_odd(logs[row], sigmas[row], usual_of(row))
        if why is not None:
            found[int(estimate.object_ids[row])] = why
    return found


def _usual(logs: Floats, least: float) -> tuple[Floats, Floats]:
    """Return the median of logarithms (n, 3), and their spread from its absolute deviations."""
    middle = np.median(logs, axis=0)
    spread = np.median(np.abs(logs - middle), axis=0) / 0.6745
    return middle, np.maximum(spread, least)


def _why_odd(log: Floats, sigma: Floats, usual: Usual) -> str | None:
    """Say which of the semi-axes with logarithms (3,) is odd, and what its sigma (3,) says."""
    middle, spread, what = usual
    off = log - middle
    worst = int(np.argmax(np.abs(off) / spread))
    if abs(off[worst]) <= MOST_SPREADS * spread[worst]:
        return None
    size = " x ".join(f"{2.0 * axis:.2g}" for axis in np.exp(log))
    known = np.isfinite(sigma[worst]) and abs(off[worst]) > OPEN_SIGMAS * sigma[worst]
    reason = (
        "its boxes show more than one thing, or it moved" if known else "its boxes leave that open"
    )
    return (
        f"it is {size} m, its {_AXES[worst]} axis {np.exp(off[worst]):.2g} times the usual one "
        f"{what}: {reason}"
    )


def _log_sigmas(estimate: Estimate, marginals: Marginals | None) -> Floats:
    """Return the standard deviations of the logarithms of semi-axes, (o, 3); NaN if unknown."""
    sigmas = np.full((len(estimate.object_ids), 3), np.nan)
    if marginals is None:
        return sigmas
    known: Ints = np.flatnonzero(
        estimate.is_ellipsoid & np.isfinite(marginals.objects).all(axis=(1, 2))
    )
    for row in known.tolist():
        variance = estimate.log_semi_axes_variances(row, marginals.objects[row])
        sigmas[row] = np.sqrt(variance.clip(min=0.0))
    return sigmas
