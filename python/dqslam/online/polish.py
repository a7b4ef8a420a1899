"""A full solve of a session, here or in the background, and its merge into what came since."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread
from typing import Protocol

import numpy as np

from dqslam import _core
from dqslam._checks import Floats

_ITERATIONS = 50


@dataclass(frozen=True, eq=False)
class Polished:
    """What a full solve found of the session as it was when it began."""

    poses: Floats
    """Shape (n, d); empty where there was nothing to do."""
    objects: int
    """Rows of objects that there were."""
    rows: list[int]
    """Those that the solve moved."""
    ellipsoids: Floats
    """Shape (len(rows), 9)."""
    cost: float
    """Half the sum of squared residuals, in sigmas, after the loss; NaN where nothing was done."""
    summary: _core.Summary | None
    """None where a map was continued, or nothing was done."""


NOTHING = Polished(np.zeros((0, 0)), 0, [], np.zeros((0, 9)), np.nan, None)
"""What is found where there is nothing to do."""


def polished(solution: _core.Solution, objects: int, rows: list[int]) -> Polished:
    """Say what a solve found of so many objects, of which it moved some rows."""
    return Polished(
        poses=solution.poses,
        objects=objects,
        rows=rows,
        ellipsoids=solution.landmarks,
        cost=solution.summary.final_cost,
        summary=solution.summary,
    )


class Polish(Protocol):
    """A solve of what a session had when the polish was made."""

    def work(self) -> Polished:
        """Solve; touches nothing but a copy of the session."""

    def merge(self, found: Polished) -> None:
        """Take over what was found: what arrived meanwhile moves along."""


class Solve:
    """The problem as ``solve`` has it, from where the session stands."""

    def __init__(self, session: _core.Session, options: _core.SolveOptions) -> None:
        """Copy what there is; a step is needed."""
        self._session = session
        self._options = options
        self._objects = session.num_objects
        self._graph, self._rows = session.to_graph()
        self._start = _core.State(session.poses, session.ellipsoids[self._rows])

    def work(self) -> Polished:
        """Solve; without a box there is nothing to do."""
        if not self._rows:
            return NOTHING
        solution = _core.solve(self._graph, self._options, self._start)
        return polished(solution, self._objects, self._rows)

    def merge(self, found: Polished) -> None:
        """Move all objects that there were."""
        _merge(found, self._session)


class Smoothing:
    """All poses of a session that continues a map.

    The map's objects are Gaussian priors, which ``solve`` has not; the session's own minimization
    has them.
    """

    def __init__(self, session: _core.Session) -> None:
        """Copy what there is."""
        self._session = session
        self._copy = session.clone()

    def work(self) -> Polished:
        """Minimize all poses of the copy."""
        copy = self._copy
        cost, count = copy.smooth(_ITERATIONS), copy.num_objects
        return Polished(copy.poses, count, list(range(count)), copy.ellipsoids, cost, None)

    def merge(self, found: Polished) -> None:
        """Move all objects that there were."""
        _merge(found, self._session)


def _merge(found: Polished, session: _core.Session) -> None:
    if len(found.poses):
        ellipsoids = session.ellipsoids[: found.objects]
        ellipsoids[found.rows] = found.ellipsoids
        session.merge(found.poses, ellipsoids)


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
