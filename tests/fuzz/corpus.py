"""Make the corpus with the simulator: `PYTHONPATH=tests ./run python -m fuzz.corpus`."""

import shutil
from dataclasses import replace

import dqslam as dq
from dqslam.io.simulated import write_recording, write_truth
from fuzz.readers import CORPUS

POSES = 12


def main() -> None:
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
    boxes, odometry = recording.detections, recording.odometry
    small = replace(
        recording,
        timestamps=recording.timestamps[:POSES],
        odometry=replace(
            odometry,
            relative=odometry.relative[: POSES - 1],
            covariance=odometry.covariance[: POSES - 1],
        ),
        detections=boxes.select(boxes.pose < POSES),
        positions=None,
    )
    short = replace(truth, poses=truth.poses[:POSES], box_object_id=None)
    CORPUS.mkdir(exist_ok=True)
    write_recording(small, CORPUS)
    write_truth(short, small, CORPUS)
    (CORPUS / "odometry.txt").replace(CORPUS / "trajectory.txt")
    (CORPUS / "groundtruth.txt").unlink()
    shutil.rmtree(CORPUS / "results", ignore_errors=True)
    graph = dq.build_graph(small)
    estimate, _ = dq.solve(graph)
    known = dq.marginal_covariances(graph, estimate)
    dq.save_estimate(estimate, CORPUS / "results", detections=small.detections, marginals=known)


if __name__ == "__main__":
    main()
