"""A full solve of a session, here or in the background, and its merge into what came since."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread

import numpy as np

from dqslam import _core
from dqslam._checks import Floats

# Of the session's own minimization, which stops where the cost does.
MAX_SMOOTHING_ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class Polished:
    """What a full solve found of the session as it was when it began."""

    poses: Floats
    """Shape (n, d); empty where there was nothing to do."""
    num_objects: int
    """How many objects the session had."""
    object_rows: list[int]
    """Rows of those that the solve moved."""
    ellipsoids: Floats
    """Of these, center and log-Cholesky shape, shape (len(object_rows), 9)."""
    cost: float
    """Half the sum of squared residuals, in sigmas, after the loss; NaN where nothing was done."""
    summary: _core.Summary | None
    """None where a map was continued, or nothing was done."""

    @classmethod
    def of(cls, solution: _core.Solution, num_objects: int, rows: list[int]) -> Polished:
        """Take what the core found of a session with so many objects, of some of their rows."""
        summary = solution.summary
        cost = summary.final_cost
        return cls(solution.poses, num_objects, rows, solution.landmarks, cost, summary)


NOTHING = Polished(np.zeros((0, 0)), 0, [], np.zeros((0, 9)), np.nan, None)
"""What is found where there is nothing to do."""


@dataclass(frozen=True, eq=False)
class Polish:
    """A solve of what a session had when the polish was made."""

    work: Callable[[], Polished]
    """Solves; touches nothing but a copy of the session."""
    merge: Callable[[Polished], None]
    """Takes over what was found: what arrived meanwhile moves along."""


def solve_all(core: _core.Session, options: _core.SolveOptions) -> Polish:
    """Make a polish of the problem as ``solve`` has it, from where the session stands."""
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

    The map's objects are Gaussian priors, which ``solve`` has not; the session's own minimization
    has them.
    """
    smoothed = core.clone()

    def work() -> Polished:
        cost = smoothed.smooth(MAX_SMOOTHING_ITERATIONS)
        rows = list(range(smoothed.num_objects))
        return Polished(smoothed.poses, len(rows), rows, smoothed.ellipsoids, cost, None)

    return Polish(work, lambda found: _move(core, found))


def _move(core: _core.Session, found: Polished) -> None:
    """Move the poses and objects that there were to where they were found."""
    if len(found.poses):
        ellipsoids = core.ellipsoids[: found.num_objects]
        ellipsoids[found.object_rows] = found.ellipsoids
        core.merge(found.poses, ellipsoids)


class Polisher:
    """Runs one polish at a time."""

    def __init__(self) -> None:
        """Begin without one."""
        self._polish: Polish | None = None
        self._found: Future[Polished] = Future()

    def start(self, polish: Polish, *, background: bool) -> Future[Polished]:
        """Run a polish now, or in a thread: the core releases the GIL."""
        found = self._found = Future()
        self._polish = polish

        def run() -> None:
            try:
                found.set_result(polish.work())
            except BaseException as error:  # whoever asks for the result gets it
                found.set_exception(error)

        if background:
            Thread(target=run, name="dqslam-polish", daemon=True).start()
        else:
            run()
            self.take()
        return found

    def take(self, *, wait: bool = False) -> None:
        """Merge what the last polish has found, if it is done."""
        polish = self._polish
        if polish is None or not (wait or self._found.done()):
            return
        self._polish = None
        polish.merge(self._found.result())
