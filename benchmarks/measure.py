"""Run programs on a problem, each time in a process of its own, and gather what they say."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from benchmarks.files import save_problem
from benchmarks.problems import Problem
from benchmarks.results import Measured, Run, Stage
from benchmarks.score import score

ROOT = Path(__file__).resolve().parents[1]
Command = list[str]


def dqslam_command(threads: int = 1) -> Command:
    """Return what solves with dqslam."""
    command = [sys.executable, "-m", "benchmarks.programs.run_dqslam"]
    return command if threads == 1 else [*command, f"--threads={threads}"]


def online_command() -> Command:
    """Return what solves with dqslam step by step."""
    return [sys.executable, "-m", "benchmarks.programs.run_online"]


def scipy_command() -> Command:
    """Return what solves with scipy."""
    return [sys.executable, "-m", "benchmarks.programs.run_scipy"]


def measure(
    case: str,
    problem: Problem,
    programs: Mapping[str, Command],
    *,
    repeat: int,
    limit_s: float,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[Measured]:
    """Run all programs in turn, again and again: what slows the machine slows them alike.

    A program that fails, or takes longer than the limit, is not run again.
    """
    boxes = problem.recording.detections
    size = {
        "poses": len(problem.truth.poses),
        "objects": len(np.unique(boxes.object_id)),
        "boxes": len(boxes),
    }
    runs: dict[str, list[Run]] = {program: [] for program in programs}
    with tempfile.TemporaryDirectory(prefix="dqslam-bench-") as folder:
        given = Path(folder) / "problem.npz"
        save_problem(problem, given)
        for round_ in range(repeat):
            for program, command in programs.items():
                if not any(run.failure for run in runs[program]):
                    progress(f"{case}: {program}, run {round_ + 1} of {repeat}")
                    answer = Path(folder) / f"{program}.npz"
                    runs[program].append(run_once(command, problem, given, answer, limit_s))
    for program in programs:
        yield Measured(case, program, size, tuple(runs[program]))


def run_once(command: Command, problem: Problem, given: Path, answer: Path, limit_s: float) -> Run:
    """Run a program on a saved problem, which writes its answer, and score that."""
    try:
        process = subprocess.run(
            [*command, str(given), str(answer)],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=limit_s,
        )
    except subprocess.TimeoutExpired:
        return Run(failure=f"not done within {limit_s:g} s")
    if process.returncode != 0:
        said = process.stderr.strip().splitlines() or [f"exit status {process.returncode}"]
        return Run(failure=said[-1])
    return read_answer(problem, answer)


def read_answer(problem: Problem, answer: Path) -> Run:
    """Read what `exchange.write_answer` wrote, and score it."""
    with np.load(answer) as arrays:
        report = json.loads(str(arrays["report"]))
        scored = score(problem, arrays["poses"], arrays["dual_quadrics"])
    stages = {name: Stage(**times) for name, times in report.pop("stages").items()}
    return Run(stages=stages, score=scored, **report)
