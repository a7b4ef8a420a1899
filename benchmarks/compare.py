"""Against a baseline: what became slower, larger or worse."""

from dataclasses import dataclass

from benchmarks.results import Measured, Results, Score

DQSLAM = "dqslam"
TOLERATED_CPU = 1.25
TOLERATED_MEMORY = 1.1
TOLERATED_ERROR = 1.01


@dataclass(frozen=True)
class Change:
    """One case, now over then."""

    case: str
    cpu: float
    """CPU time, ratio."""
    yardstick: str
    """The program whose own ratio was divided out, as it slows with the machine; or nothing."""
    memory: float
    """Peak, ratio."""
    complaints: tuple[str, ...]
    """slower, larger, worse answer, fails."""


def compare(now: Results, then: Results) -> list[Change]:
    """Compare dqslam on every case that is in both."""
    changes = []
    for before in then.measured:
        measured = [one.case for one in now.measured if one.program == DQSLAM]
        if before.program != DQSLAM or before.failure or before.case not in measured:
            continue
        after = now.find(before.case, DQSLAM)
        if after is None:
            changes.append(Change(before.case, float("nan"), "", float("nan"), ("fails",)))
        else:
            changes.append(_change(before, after, *_machine(before.case, now, then)))
    return changes


def _machine(case: str, now: Results, then: Results) -> tuple[float, str]:
    """Return how much slower a peer became on a case, and which; 1 where none is in both."""
    for program in dict.fromkeys(one.program for one in now.measured if one.program != DQSLAM):
        after, before = now.find(case, program), then.find(case, program)
        if after is not None and before is not None:
            return after.cpu_s()[0] / before.cpu_s()[0], program
    return 1.0, ""


def _change(before: Measured, after: Measured, machine: float, yardstick: str) -> Change:
    cpu = after.cpu_s()[0] / before.cpu_s()[0] / machine
    memory = after.peak_mb / before.peak_mb
    complaints = {
        "slower": cpu > TOLERATED_CPU,
        "larger": memory > TOLERATED_MEMORY,
        "worse answer": _is_worse(after.runs[0].score, before.runs[0].score),
    }
    said = tuple(word for word, is_so in complaints.items() if is_so)
    return Change(before.case, cpu, yardstick, memory, said)


def _is_worse(after: Score | None, before: Score | None) -> bool:
    if after is None or before is None:
        return after is None
    return (
        after.impossible_boxes > before.impossible_boxes
        or after.aligned_rmse_m > TOLERATED_ERROR * before.aligned_rmse_m
        or after.box_rms_px > TOLERATED_ERROR * before.box_rms_px
    )
