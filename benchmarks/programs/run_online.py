"""Feed a problem to a session step by step, then polish: what each step takes.

python -m benchmarks.programs.run_online PROBLEM.npz ANSWER.npz      (as the others)
python -m benchmarks.programs.run_online CASE [SEED [NOISE]]          (prints, with the truth)
"""

import sys
import time

import numpy as np

from benchmarks.exchange import Stopwatch, peak_memory_mb, write_answer
from benchmarks.files import load_problem
from benchmarks.problems import NOISE, SIZES
from dqslam import OnlineSlam, Recording, build_graph, solve, steps_of
from dqslam._checks import Floats


def feed(recording: Recording) -> tuple[OnlineSlam, Floats, Floats]:
    """Return the session, and the wall clock and processor time of each step, ms, (n,)."""
    slam = OnlineSlam(recording.camera, box_noise=NOISE)
    taken = []
    for step in steps_of(recording):
        wall, cpu = time.perf_counter(), time.thread_time()
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        taken.append((time.perf_counter() - wall, time.thread_time() - cpu))
    wall_ms, cpu_ms = 1e3 * np.array(taken).T
    return slam, wall_ms, cpu_ms


def main(problem: str, answer: str) -> None:
    """Read a problem, write the answer."""
    recording, _ = load_problem(problem)
    stopwatch = Stopwatch()
    with stopwatch("build"):
        slam, wall_ms, _ = feed(recording)
    with stopwatch("solve"):
        polished = slam.polish().result()
    estimate = slam.estimate()
    write_answer(
        answer,
        estimate.poses,
        estimate.dual_quadrics,
        stopwatch,
        iterations=polished.summary.iterations if polished.summary else 0,
        cost=polished.cost,
        step_ms=spread(wall_ms),
    )


def spread(milliseconds: Floats) -> dict[str, float]:
    """Return what steps usually take, and at worst."""
    return {
        "p50": float(np.median(milliseconds)),
        "p99": float(np.percentile(milliseconds, 99)),
        "worst": float(milliseconds.max()),
        "total": float(milliseconds.sum()),
    }


def show(case: str, seed: int = 0, noise: float | None = None) -> None:
    """Print what a case takes, and how far the estimates are from the truth."""
    from benchmarks.cases import CASES

    problem = CASES[case].problem(seed, noise)
    recording = problem.recording
    before_mb = peak_memory_mb()
    slam, wall_ms, cpu_ms = feed(recording)
    online, memory_mb = slam.poses, peak_memory_mb() - before_mb
    started = time.perf_counter()
    polished = slam.polish().result()
    polish_s = time.perf_counter() - started
    estimate, summary = solve(build_graph(recording, box_noise=NOISE, size_prior=SIZES))

    def rmse(poses: Floats) -> float:
        apart = (poses - problem.truth.poses)[:, :2]
        return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))

    rows = {"wall clock": wall_ms, "processor": cpu_ms}
    lines = [f"{case}, seed {seed}: {len(wall_ms)} steps, {len(recording.detections)} boxes"]
    for name, milliseconds in rows.items():
        values = ", ".join(f"{key} {value:.3g}" for key, value in spread(milliseconds).items())
        lines.append(f"{name}: {values} ms")
    late = len(wall_ms) // 2
    lines.append(
        f"median of the halves: {np.median(cpu_ms[:late]):.3f}, {np.median(cpu_ms[late:]):.3f} ms"
    )
    lines.append(f"memory: {memory_mb:.1f} MB")
    lines.append(
        f"RMSE: online {rmse(online):.4f}, polished {rmse(slam.poses):.4f}, "
        f"batch {rmse(estimate.poses):.4f} m"
    )
    lines.append(
        f"cost: polished {polished.cost:.4f} in {polish_s:.2f} s, batch {summary.final_cost:.4f}"
    )
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    if sys.argv[1].endswith(".npz"):
        main(*sys.argv[1:])
    else:
        name, *numbers = sys.argv[1:]
        show(name, *map(int, numbers[:1]), *map(float, numbers[1:2]))
