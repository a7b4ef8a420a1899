"""A full solve of a session, here or in the background."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread

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


def polish_session(
    session: _core.Session, options: _core.SolveOptions, *, keeps_map: bool
) -> Callable[[], Polished]:
    """Copy what a session has and return the work on the copy.

    ``keeps_map`` is for a map that was loaded: its objects are Gaussian priors, which ``solve`` has
    not; the session's own minimisation over all poses has them.
    """
    if keeps_map:
        copy = session.clone()
        return lambda: _smoothed(copy)
    graph, rows = session.to_graph() if session.num_poses else (None, [])
    if not rows or graph is None:
        return lambda: Polished(np.zeros((0, 0)), 0, [], np.zeros((0, 9)), np.nan, None)
    start = _core.State(session.poses, session.ellipsoids[rows])
    objects = session.num_objects

    def work() -> Polished:
        solution = _core.solve(graph, options, start)
        return Polished(
            poses=solution.poses,
            objects=objects,
            rows=rows,
            ellipsoids=solution.landmarks,
            cost=solution.summary.final_cost,
            summary=solution.summary,
        )

    return work


def _smoothed(copy: _core.Session) -> Polished:
    cost = copy.smooth(_ITERATIONS)
    count = copy.num_objects
    return Polished(copy.poses, count, list(range(count)), copy.ellipsoids, cost, None)


def start_polish(work: Callable[[], Polished], *, background: bool) -> Future[Polished]:
    """Run the work now, or in a thread: the core releases the GIL."""
    future: Future[Polished] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:  # whoever asks for the result gets it
            future.set_exception(error)

    if background:
        Thread(target=run, name="dqslam-polish", daemon=True).start()
    else:
        run()
    return future
