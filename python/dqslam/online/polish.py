"""A full solve of a session, now or in the background, and the merge of its result."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread

import numpy as np

from dqslam import _core
from dqslam._checks import Floats

# The most iterations of the session's own minimization, which stops when the cost does.
MAX_SMOOTHING_ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class Polished:
    """The result of a full solve, for the session at the time when the solve began."""

    poses: Floats
    """Shape (n, d); empty if nothing was done."""
    num_objects: int
    """Number of objects of the session."""
    object_rows: list[int]
    """Rows of the objects that the solve moved."""
    ellipsoids: Floats
    """Their centers and log-Cholesky shapes, shape (len(object_rows), 9)."""
    cost: float
    """Half the sum of squared residuals, in sigmas, after the loss; NaN if nothing was done."""
    summary: _core.Summary | None
    """None if a map was continued, or nothing was done."""

    @classmethod
    def of(cls, solution: _core.Solution, num_objects: int, rows: list[int]) -> Polished:
        """Make the result from a solution of the core, for these rows of the session's objects."""
        summary = solution.summary
        cost = summary.final_cost
        return cls(solution.poses, num_objects, rows, solution.landmarks, cost, summary)


NOTHING = Polished(np.zeros((0, 0)), 0, [], np.zeros((0, 9)), np.nan, None)
"""The result if there is nothing to do."""


@dataclass(frozen=True, eq=False)
class Polish:
    """A solve of the session at the time when the polish was made."""

    work: Callable[[], Polished]
    """Solves, and changes only a copy of the session."""
    merge: Callable[[Polished], None]
    """Merges the result into the session; later poses and objects move with it."""


def solve_all(core: _core.Session, options: _core.SolveOptions) -> Polish:
    """Make a polish that solves the problem, starting from the state of the session."""
    num_objects = core.num_objects
    graph, rows = core.to_graph()
    start = _core.State(core.poses, core.ellipsoids[rows])

    def work() -> Polished:
        if not rows:
            return NOTHING
        return Polished.of(_core.solve(graph, options, start), num_objects, rows)

    return Polish(work, lambda found: _move(core, found))


def smooth_all(core: _core.Session) -> Polish:
    """Make a polish of all poses of a session that continues a map.

    The objects of the map are Gaussian priors. ``solve`` does not have such priors, but the
    session's own minimization has.
    """
    smoothed = core.clone()

    def work() -> Polished:
        cost = smoothed.smooth(MAX_SMOOTHING_ITERATIONS)
        rows = list(range(smoothed.num_objects))
        return Polished(smoothed.poses, len(rows), rows, smoothed.ellipsoids, cost, None)

    return Polish(work, lambda found: _move(core, found))


def _move(core: _core.Session, found: Polished) -> None:
    """Set the poses and objects of a solve to its result."""
    if len(found.poses):
        ellipsoids = core.ellipsoids[: found.num_objects]
        ellipsoids[found.object_rows] = found.ellipsoids
        core.merge(found.poses, ellipsoids)


class Polisher:
    """Runs one polish at a time."""

    def __init__(self) -> None:
        """Begin without a polish."""
        self._polish: Polish | None = None
        self._found: Future[Polished] = Future()

    def start(self, polish: Polish, *, background: bool) -> Future[Polished]:
        """Run a polish now, or in a thread: the core releases the GIL."""
        found = self._found = Future()
        self._polish = polish

        def run() -> None:
            try:
                found.set_result(polish.work())
            except BaseException as error:  # raised by result()
                found.set_exception(error)

        if background:
            Thread(target=run, name="dqslam-polish", daemon=True).start()
        else:
            run()
            self.take()
        return found

    def take(self, *, wait: bool = False) -> None:
        """Merge the result of the last polish, if it is done."""
        polish = self._polish
        if polish is None or not (wait or self._found.done()):
            return
        self._polish = None
        polish.merge(self._found.result())
