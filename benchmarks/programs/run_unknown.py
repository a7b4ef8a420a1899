"""Feed a problem to a session whose boxes have no ids: what it takes, and what it finds.

python -m benchmarks.programs.run_unknown CASE [SEED [NOISE]]

Beside it, the association of the whole recording, and the estimate with the true ids.
"""

import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.cases import CASES
from benchmarks.problems import NOISE
from benchmarks.programs.run_online import spread
from dqslam import Loss, OnlineSlam, Recording, SolveOptions, associate, build_graph, solve
from dqslam._checks import Floats, Ints
from dqslam.association import UNSURE, fill_in
from dqslam.metrics import score_association
from dqslam.online import replay


def main(case: str, seed: int = 0, noise: float | None = None) -> None:
    """Print what a case takes, and how far the estimates are from the truth."""
    problem = CASES[case].problem(seed, noise)
    recording = replace(problem.recording, positions=None)
    detections = recording.detections
    nothing = np.full(len(detections), -1)
    unknown = replace(recording, detections=replace(detections, object_id=nothing))
    slam = OnlineSlam(
        recording.camera,
        SolveOptions(loss=Loss.CAUCHY, loss_scale=2.0),
        first_pose=recording.odometry.first_pose,
        box_noise=NOISE,
        trust_ids=UNSURE,
    )

    def show(what: str, poses: Floats, shown: Ints | None, seconds: float) -> None:
        apart = (poses - problem.truth.poses)[:, :2]
        words = [f"{what}: RMSE {np.sqrt(np.mean(np.sum(apart**2, axis=1))):.3f} m"]
        if shown is not None:
            score = score_association(detections.pose, shown, detections.object_id)
            words.append(
                f"found {score.found}, missed {score.missed}, split {score.split}, "
                f"purity {score.purity:.3f}, recall {score.recall:.3f}"
            )
        sys.stdout.write(", ".join([*words, f"{seconds:.1f} s"]) + "\n")

    taken = np.array([frame.milliseconds for frame in replay(slam, unknown)])
    keyframes, objects = len(slam.keyframes), len(np.unique(detections.object_id))
    sys.stdout.write(
        f"{case}, seed {seed}: {len(taken)} steps, {keyframes} keyframes, {objects} objects\n"
        + ", ".join(f"{key} {value:.3g}" for key, value in spread(taken).items())
        + " ms\n"
    )
    show("step by step", slam.poses, _by_box(slam, recording), taken.sum() / 1e3)
    started = time.perf_counter()
    slam.polish()
    seconds = time.perf_counter() - started
    show("polished", slam.poses, _by_box(slam, recording), seconds)
    started = time.perf_counter()
    found = associate(unknown, estimates_noise=False, box_noise=NOISE)
    poses = fill_in(unknown, found.keyframes, found.scene.poses)
    show("associate", poses, found.object_id, time.perf_counter() - started)
    estimate, summary = solve(build_graph(recording, box_noise=NOISE))
    show("oracle ids", estimate.poses, None, summary.seconds)


def _by_box(slam: OnlineSlam, recording: Recording) -> Ints:
    """Return what the boxes show in the order of the recording, shape (m,)."""
    shown = np.empty(len(recording.detections), dtype=np.int64)
    order = np.argsort(recording.detections.pose, kind="stable")
    shown[order] = np.concatenate(slam.assignments)
    return shown


if __name__ == "__main__":
    name, *numbers = sys.argv[1:]
    main(name, *map(int, numbers[:1]), *map(float, numbers[1:2]))
