"""An offset of the clocks of images and poses, looked for far from the one in use.

The score of a delay sees only its surroundings, and a path that was fitted to the boxes of other
times hides some of it. Here the boxes of a finished map are given to the poses of other times, path
and objects settle anew, and the costs of all these times are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools
from dqslam.graph import Graph
from dqslam.io import nearest_pose
from dqslam.subgraph import rebuilt, select_objects, select_poses

# The least number of images, and of boxes, that tell.
FEWEST_IMAGES, FEWEST_BOXES = 20, 60
# Offsets that are tried first, in images; the range is doubled while the best one is at its end, up
# to this share of the recording.
FIRST, LARGEST_SHARE = (1, 2, 4), 0.1
# An offset is sure if it lessens half of the sum of squares by this, and is so many sigmas from 0.
SURE_GAIN, SURE_SIGMAS = 12.0, 4.0
# A box belongs to a pose at most this far from its time, in intervals of images.
NEAR = 0.5 + 1e-6
ITERATIONS = 30
# Between the offsets of whole images, a parabola has the least cost: its error, in intervals.
OF_PARABOLA = 0.1


@dataclass(frozen=True)
class ClockError:
    """How much later than their time stamps the images of a recording were taken."""

    seconds: float
    """In the middle of the recording."""
    sigma: float
    """Standard deviation of ``seconds``."""
    gain: float
    """By how much half of the sum of squares is less then."""
    rate: float
    """By how much ``seconds`` grows in a second; 0 where that is not sure."""
    middle: float
    """The time stamp of the middle, s."""

    @property
    def is_sure(self) -> bool:
        """Whether it is far beyond what noise does."""
        return self.gain >= SURE_GAIN and abs(self.seconds) >= SURE_SIGMAS * self.sigma

    def __str__(self) -> str:
        """Say it in a sentence, with the options that mend it."""
        if self.rate:
            scale, offset = scale_and_offset(self.rate, self.seconds, self.middle)
            return (
                f"the clock of the boxes has another rate than that of the poses: the map fits "
                f"them better with --time-scale {scale:g} --time-offset {offset:.3f}"
            )
        when = "later" if self.seconds > 0 else "earlier"
        return (
            f"the map fits boxes better that are {abs(self.seconds):.3g} ± {self.sigma:.2g} s "
            f"{when} than their times say: --time-offset {self.seconds:.3g}, or --estimate "
            "time_offset"
        )


def scale_and_offset(rate: float, seconds: float, middle: float) -> tuple[float, float]:
    """Return the factor of times, and the seconds to add then, that mend a clock.

    It is ``seconds`` late at the time ``middle`` and loses ``rate`` seconds in each. The factor has
    few digits, and the offset is that for this factor: times may be those since 1970.
    """
    scale = round(1.0 + rate, 4)
    return scale, seconds - (scale - 1.0) * middle


def find_clock_error(graph: Graph, state: _core.State) -> ClockError | None:
    """Find the offset of time with which the boxes of a map fit best.

    Parameters
    ----------
    graph
        The problem of a finished map, with the noise that is believed.
    state
        Its poses and objects.

    Returns
    -------
    ClockError or None
        None where there are too few images, or where no offset that is tried has a least cost.
    """
    return _Search(graph, state).found()


class _Search:
    """Costs of the boxes of some time at other times, each with path and objects settled anew."""

    def __init__(self, graph: Graph, state: _core.State, within: Bools | None = None) -> None:
        table = graph.core.boxes
        rows = np.arange(len(table.pose)) if within is None else np.flatnonzero(within)
        self._graph, self._state, self._rows = graph, state, rows
        self._stamp = graph.timestamps[table.pose[rows]]
        images = np.unique(self._stamp)
        self._enough = len(images) >= FEWEST_IMAGES and len(rows) >= FEWEST_BOXES
        self._interval = float(np.median(np.diff(images))) if len(images) > 1 else 0.0
        self._largest = LARGEST_SHARE * len(images)
        self.middle = float(np.median(self._stamp)) if len(rows) else 0.0

    def found(self) -> ClockError | None:
        offset = self.offset()
        if offset is None:
            return None
        seconds, sigma, gain = offset
        rate = 0.0
        if gain >= SURE_GAIN:
            rate = self._rate(seconds)
        return ClockError(seconds, sigma, gain, rate, self.middle)

    def offset(self) -> tuple[float, float, float] | None:
        """Return the best offset [s], its standard deviation, and the gain of it."""
        if not self._enough:
            return None
        tried = [0, *FIRST, *(-one for one in FIRST)]
        costs, level = self._costs(tried)
        best, largest = tried[int(np.argmin(costs))], FIRST[-1]
        if best == 0:
            known = dict(zip(tried, costs, strict=True))
            return self._least(0, (known[0], known[-1], known[0], known[1]), level)
        while abs(best) == largest and 2 * largest <= self._largest:
            side = int(np.sign(best)) * largest
            best, largest = self._best([0, side // 2, side, 3 * side // 2, 2 * side]), 2 * largest
        gap = largest // 4
        while gap >= 1:
            best = self._best([0, best - gap, best, best + gap])
            gap //= 2
        costs, level = self._costs([0, best - 1, best, best + 1])
        return self._least(best, costs, level)

    def _least(
        self, best: int, costs: Sequence[float], level: float
    ) -> tuple[float, float, float] | None:
        """Return what ``offset`` does, from the costs at 0, and before, at and after the best."""
        given, before, here, after = costs
        bend = before - 2 * here + after
        if not bend > 0.0 or here > min(before, after):
            return None
        moved = 0.5 * (before - after) / bend
        gain = given - here + 0.125 * (before - after) ** 2 / bend
        seconds = self._interval * (best + moved)
        sigma = self._interval * float(np.hypot(np.sqrt(level / bend), OF_PARABOLA))
        return seconds, sigma, gain / level

    def _rate(self, seconds: float) -> float:
        """Return the growth of the offset, 0 unless both halves of the time surely differ."""
        halves = []
        for within in (self._stamp < self.middle, self._stamp >= self.middle):
            chosen = np.zeros(len(self._graph.core.boxes.pose), dtype=bool)
            chosen[self._rows[within]] = True
            half = _Search(self._graph, self._state, chosen)
            offset = half.offset()
            if offset is None:
                return 0.0
            halves.append((half.middle, *offset))
        (start, first, first_sigma, _), (end, second, second_sigma, _) = halves
        if abs(second - first) < SURE_SIGMAS * np.hypot(first_sigma, second_sigma):
            return 0.0
        return (second - first) / (end - start)

    def _best(self, images: list[int]) -> int:
        return images[int(np.argmin(self._costs(images)[0]))]

    def _costs(self, images: list[int]) -> tuple[list[float], float]:
        """Return the costs at offsets in images, of the boxes that have poses at each of them.

        And the least cost of a degree of freedom, 1 or more: the level of the noise of boxes.
        """
        times = self._graph.timestamps
        poses, near = [], np.ones(len(self._rows), dtype=bool)
        for one in images:
            pose, late = nearest_pose(times, self._stamp + one * self._interval)
            poses.append(pose)
            near &= late <= NEAR * self._interval
        options = _core.SolveOptions(
            residual=_core.Residual.BOX,
            loss=_core.Loss.CAUCHY,
            schedule=_core.Schedule.BATCH,
            max_iterations=ITERATIONS,
        )
        costs = []
        for pose in poses:
            core, state = self._moved(pose[near], self._rows[near])
            try:
                costs.append(float(_core.solve(core, options, state).summary.final_cost))
            except (RuntimeError, ValueError):  # an object is not in front of a camera
                costs.append(np.inf)
        return costs, max(1.0, 2.0 * min(costs) / max(4 * int(near.sum()), 1))

    def _moved(self, pose: np.ndarray, rows: np.ndarray) -> tuple[_core.Graph, _core.State]:
        """Return the problem of some boxes at these poses, and its start."""
        core, table = self._graph.core, self._graph.core.boxes
        shown = np.unique(table.object[rows])
        place = np.full(core.num_objects, -1)
        place[shown] = np.arange(len(shown))
        boxes = _core.BoxTable(
            pose=pose,
            object=place[table.object[rows]],
            box=table.box[rows],
            covariance=table.covariance[rows],
            truncated=table.truncated[rows],
        )
        whole = core if len(shown) == core.num_objects else select_objects(core, shown)
        # Poses that nothing is measured from follow their neighbors: they would only cost time.
        kept = np.unique(np.concatenate([pose, *(one.pose for one in whole.measurements)]))
        moved = select_poses(rebuilt(whole, boxes=boxes), kept)
        poses = self._state.poses
        return moved, _core.State(
            poses[kept] if moved.num_poses == len(kept) else poses,
            self._state.landmarks[shown],
            shared=self._state.shared,
        )
