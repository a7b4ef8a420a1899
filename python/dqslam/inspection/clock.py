"""The offset between the clocks of poses and boxes, from how boxes move between two views.

Each step of odometry has noise of its own, and boxes that are compared with the steps of another
time miss more. The sum of the misses of all steps is least at the offset of the clocks.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np

from dqslam.calibration import scale_and_offset
from dqslam.inspection.clock_costs import TimeCosts, step_costs, window_costs
from dqslam.inspection.evidence import Evidence, Finding, Floats, NotEnoughDataError
from dqslam.inspection.windows import MOST_WINDOWS

# Offsets that are tried: steps to each side.
STEPS, FEW_STEPS = 12, 8
# An offset is sure if boxes miss less by this number of standard deviations, and if it is so many
# of its own from zero. Smaller motions within it are no mistake [px].
SURE_GAIN, SURE_OFFSET, LEAST_MOTION_PX = 2.0, 3.5, 2.5
# Beyond this share of the range, a path that repeats itself may fit as well.
WITHIN = 0.75
RESAMPLES = 200
SURE_DRIFT = 3.5
MOST_CLOCK_WINDOWS = 5 * MOST_WINDOWS


@dataclass(frozen=True)
class ClockOffset:
    """How much later than their times boxes were taken, by the clock of the poses."""

    seconds: float
    """Boxes fit best if this is added to their times."""
    sigma: float
    """Standard deviation of it; infinite where the least miss is at the end of the range."""
    gain_sigmas: float
    """By how many standard deviations boxes miss less then."""
    motion_px: float
    """Median motion of the middles of boxes in that time."""
    drift: float
    """How much it grows in a second."""
    drift_sigma: float
    """Standard deviation of it; infinite if it is not known."""

    @property
    def sure(self) -> bool:
        """Whether boxes do fit better, and by more than what noise does."""
        return (
            self.gain_sigmas >= SURE_GAIN
            and abs(self.seconds) >= SURE_OFFSET * self.sigma
            and self.motion_px >= LEAST_MOTION_PX
        )

    @property
    def drifts(self) -> bool:
        """Whether the offset surely changes."""
        return abs(self.drift) >= SURE_DRIFT * self.drift_sigma


def estimate_clock_offset(
    evidence: Evidence, *, steps: int = STEPS, most: int = MOST_CLOCK_WINDOWS
) -> ClockOffset:
    """Find the offset of the clocks at which boxes move most like the poses say.

    It is looked for within a number of steps, intervals of poses or half those of images, in at
    most so many windows of a length, and between successive images. Of both estimates one that
    surely drifts counts, then a sure one, or else the one with the smaller spread.

    Raises
    ------
    NotEnoughDataError
        If too few boxes move from view to view.
    """
    step = _step(evidence)
    offsets = step * np.arange(-steps, steps + 1, dtype=float)
    speed = _speed(evidence)
    found: list[ClockOffset] = []
    with contextlib.suppress(NotEnoughDataError):
        found.append(_offset(window_costs(evidence, offsets, most), step, speed))
    with contextlib.suppress(NotEnoughDataError):
        found.append(_offset(step_costs(evidence, offsets), step, speed))
    if not found:
        raise NotEnoughDataError("too few boxes move from view to view")
    return min(found, key=lambda one: (not one.drifts, not one.sure, one.sigma))


def _offset(compared: TimeCosts, step: float, speed: float) -> ClockOffset:
    """Return the offset with the least costs; offsets are a step [s] apart, 0 in the middle.

    ``speed`` is that of boxes [px/s].
    """
    costs = compared.costs
    count, steps = len(costs), costs.shape[1] // 2
    best, inside = _least(costs.sum(axis=0))
    spread = compared.wider * _spread(costs)
    gains = costs[:, steps] - costs[:, int(np.clip(round(best), 0, 2 * steps))]
    noise = float(gains.std(ddof=1)) / np.sqrt(count)
    seconds = step * (best - steps)
    drift, drift_sigma = _drift(costs, compared.when)
    return ClockOffset(
        seconds=seconds,
        sigma=step * max(spread, 0.05)
        if inside and abs(best - steps) <= WITHIN * steps
        else np.inf,
        gain_sigmas=float(gains.mean()) / max(noise, 1e-12),
        motion_px=abs(seconds) * speed,
        drift=step * drift,
        drift_sigma=step * compared.wider * drift_sigma,
    )


def check_clock_shortly(evidence: Evidence) -> Finding | None:
    """Check whether boxes fit better at times nearby, with few windows."""
    return _judge(evidence, estimate_clock_offset(evidence, steps=FEW_STEPS, most=MOST_WINDOWS))


def check_clock(evidence: Evidence) -> Finding | None:
    """Check whether boxes fit better at other times: an offset, or another rate of the clock."""
    return _judge(evidence, estimate_clock_offset(evidence))


def _judge(evidence: Evidence, clock: ClockOffset) -> Finding | None:
    if clock.drifts:
        scale, offset = scale_and_offset(
            clock.drift, clock.seconds, float(np.median(evidence.table.timestamp))
        )
        return Finding(
            "clock",
            f"the clocks drift apart by {1e3 * clock.drift:.3g} ± {1e3 * clock.drift_sigma:.2g} ms "
            f"a second: --time-scale {scale:g} --time-offset {offset:.3f}, or another rate of "
            "frames",
        )
    if not clock.sure:
        return None
    interval = float(np.median(np.diff(np.unique(evidence.table.timestamp))))
    return Finding(
        "clock",
        f"boxes fit best {abs(clock.seconds):.3g} ± {clock.sigma:.2g} s "
        f"{'later' if clock.seconds > 0 else 'earlier'} than their times say, that is "
        f"{abs(clock.seconds) / interval:.2g} images: --time-offset {clock.seconds:.3g}",
    )


def _step(evidence: Evidence) -> float:
    """Return a multiple of the interval of poses of at least half the interval of images [s].

    Between two poses, half of the noise of both steps is left: only offsets by whole intervals have
    the same noise.
    """
    interval = float(np.median(np.diff(evidence.trajectory.timestamps)))
    images = np.diff(np.unique(evidence.table.timestamp))
    if not images.size:
        raise NotEnoughDataError("all boxes are of one time")
    return interval * max(1, round(0.5 * float(np.median(images)) / interval))


def _drift(costs: Floats, when: Floats) -> tuple[float, float]:
    """Return the change of the best offset in a second, in steps, and its standard deviation."""
    thirds = np.array_split(np.arange(len(costs)), 3)
    found, spreads = [], []
    for rows in thirds:
        best, inside = _least(costs[rows].sum(axis=0))
        spread = _spread(costs[rows])
        found.append(best)
        spreads.append(max(spread, 0.1) if inside else np.inf)
    time = float(when[thirds[2]].mean() - when[thirds[0]].mean())
    between = min(found[0], found[2]) - 1 <= found[1] <= max(found[0], found[2]) + 1
    sigma = float(np.hypot(spreads[0], spreads[2])) if between else np.inf
    return (found[2] - found[0]) / time, sigma / time


def _spread(costs: Floats) -> float:
    """Return the standard deviation of the least, if other parts of the time had been seen."""
    random = np.random.default_rng(0)
    count = len(costs)
    drawn = random.multinomial(count, np.full(count, 1 / count), RESAMPLES)
    # Parts that are drawn from each other vary less than the parts themselves.
    few = np.sqrt(count / (count - 1))
    return float(few * np.std([_least(total)[0] for total in drawn @ costs]))


def _least(costs: Floats) -> tuple[float, bool]:
    """Return where costs (k,) are least, between the entries, and whether that is inside."""
    row = int(np.argmin(costs))
    if row in (0, len(costs) - 1):
        return float(row), False
    before, here, after = costs[row - 1 : row + 2]
    bend = before - 2 * here + after
    return row + (0.5 * (before - after) / bend if bend > 0 else 0.0), True


def _speed(evidence: Evidence) -> float:
    """Return the median speed of the middles of boxes [px/s]."""
    table = evidence.table
    middle = (table.box[:, :2] + table.box[:, 2:]) / 2
    speeds = [
        np.linalg.norm(np.diff(middle[track], axis=0), axis=1) / np.diff(table.timestamp[track])
        for track in evidence.tracks()
    ]
    return float(np.median(np.concatenate(speeds)))
