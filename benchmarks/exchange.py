"""Problems and answers as files, between processes whose interpreters differ.

Here and in `programs/` that a peer's interpreter runs: NumPy and Python 3.10 only.
"""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

STAGES = ("build", "start", "solve")


class Stopwatch:
    """Times stages; each has a name of STAGES."""

    def __init__(self) -> None:
        """Start with no stage."""
        self.stages: dict[str, dict[str, float]] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add what happens inside to a stage: seconds of the wall clock, and of all threads."""
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        before = self.stages.get(stage, {"wall_s": 0.0, "cpu_s": 0.0})
        self.stages[stage] = {
            "wall_s": before["wall_s"] + time.perf_counter() - wall,
            "cpu_s": before["cpu_s"] + time.process_time() - cpu,
        }


def peak_memory_mb() -> float:
    """Return the most memory that this process has had, in megabytes (Linux).

    Not getrusage: its figure starts with that of the parent, which made the problem.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(
        int(line.split()[1]) / 1024.0 for line in status.splitlines() if line.startswith("VmHWM:")
    )


def write_answer(
    path: str,
    poses: np.ndarray,
    dual_quadrics: np.ndarray,
    stopwatch: Stopwatch,
    **facts: "float | str | dict[str, float] | None",
) -> None:
    """Write what a program found, and what that took.

    Parameters
    ----------
    poses
        world_from_robot, shape (n, 3) in SE(2) or (n, 7) in SE(3), as in `blocks.h`.
    dual_quadrics
        q1 .. q9 of the objects with boxes, ids ascending, shape (o, 9).
    facts
        What `results.Run` has under the same name: `iterations`, `cost`, `program`, ...
    """
    report = {"stages": stopwatch.stages, "peak_mb": peak_memory_mb(), **facts}
    np.savez(path, poses=poses, dual_quadrics=dual_quadrics, report=json.dumps(report))
