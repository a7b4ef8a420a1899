"""A full solve of a session, now or in the background, and the merge of its result."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

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

    @property
    def running(self) -> Future[Polished] | None:
        """The result of a polish that is not done, to wait for; None if there is none."""
        return None if self._polish is None or self._found.done() else self._found

    @property
    def is_done(self) -> bool:
        """Whether a polish is done and waits to be merged."""
        return self._polish is not None and self._found.done()

    def begin(self, polish: Polish) -> tuple[Callable[[], None], Future[Polished]]:
        """Return the work of a polish, which may run in any thread, and its result."""
        found: Future[Polished] = Future()
        self._found, self._polish = found, polish

        def run() -> None:
            try:
                found.set_result(polish.work())
            except BaseException as error:  # raised by result()
                found.set_exception(error)

        return run, found

    def take(self) -> None:
        """Merge the result of the last polish, if it is done. One that has failed changes nothing.

        Its error is raised by the ``result()`` of its future, not here.
        """
        polish = self._polish
        if polish is None or not self._found.done():
            return
        self._polish = None
        if self._found.exception() is None:
            polish.merge(self._found.result())
