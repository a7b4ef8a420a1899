"""Solve with dqslam, from odometry alone, as `dqslam.solve` does by default."""

import sys

from benchmarks.exchange import Stopwatch, write_answer
from benchmarks.files import load_problem
from benchmarks.problems import NOISE, SIZES
from dqslam import SolveOptions, Summary, build_graph, solve


def main(problem: str, answer: str, threads: int = 1) -> None:
    """Read a problem, write the answer."""
    recording, _ = load_problem(problem)
    stopwatch = Stopwatch()
    with stopwatch("build"):
        graph = build_graph(recording, box_noise=NOISE, size_prior=SIZES)
    with stopwatch("solve"):
        estimate, summary = solve(graph, SolveOptions(threads=threads))
    write_answer(
        answer,
        estimate.poses,
        estimate.dual_quadrics,
        stopwatch,
        iterations=summary.iterations,
        cost=summary.final_cost,
        **split(summary),
    )


def split(summary: Summary) -> dict[str, float | None]:
    """Return where the time of the solve went, None for what the core does not tell."""
    names = ("start_seconds", "evaluation_seconds", "linear_solver_seconds")
    return {name: getattr(summary, name, None) for name in names}


if __name__ == "__main__":
    *options, problem, answer = sys.argv[1:]
    main(problem, answer, *(int(option.removeprefix("--threads=")) for option in options))
