"""What a session holds beside what a polish finds: means over several drives."""

import numpy as np
import pytest
from benchmarks.problems import chain, paper

from dqslam.online import OnlineSlam, StepBoxes, steps_of
from test_online_loops import CAMERA, NOISE, ring


def circle(seed, noise):
    """188 m, closed after 420 steps."""
    truth, motions, boxes = ring(seed, noise)
    return CAMERA, list(zip([None, *motions], boxes, strict=True)), truth


def steps(problem):
    given = [(step.odometry, step.boxes) for step in steps_of(problem.recording)]
    return problem.recording.camera, given, problem.truth.poses


def errors(camera, given, truth):
    """RMSE before a polish and after it, meters."""

    def rmse():
        apart = (slam.poses - truth)[:, :2]
        return np.sqrt(np.mean(np.sum(apart**2, axis=1)))

    slam = OnlineSlam(camera, box_noise=NOISE)
    for motion, boxes in given:
        slam.add(motion, boxes)
    before = rmse()
    slam.polish()
    return before, rmse()


# With 0.02 m and 0.02 rad of noise a step, but for the first.
DRIVES = {
    "a third of the noise around a circle": [
        lambda seed=seed: circle(seed, 0.3) for seed in range(4)
    ],
    # The last two are the hardest of forty.
    "around a circle": [lambda seed=seed: circle(seed, 1.0) for seed in (0, 1, 2, 3, 8, 27)],
    "the paper's": [lambda seed=seed: steps(paper(seed, 1.0)) for seed in range(6)],
    "through three areas": [lambda seed=seed: steps(chain(3, 11, seed, 1.0)) for seed in range(3)],
}


@pytest.mark.parametrize("drives", DRIVES.values(), ids=DRIVES.keys())
def test_a_session_is_nearly_as_good_as_its_polish(drives):
    before, after = np.array([errors(*drive()) for drive in drives]).T
    assert np.mean(before) <= 1.25 * np.mean(after)
    assert np.median(before / after) <= 1.25


@pytest.mark.parametrize("seed", range(2))
def test_boxes_that_show_something_else_do_not_mislead_a_session(seed):
    """One box of ten lies somewhere else, one of ten has the id of another object."""
    problem = paper(seed, 0.5)
    random = np.random.default_rng(seed)
    camera, given, truth = steps(problem)
    names = np.unique(problem.recording.detections.object_id)
    misled = []
    for motion, boxes in given:
        box, ids = boxes.box.copy(), np.array(boxes.object_id)
        for row in np.flatnonzero(random.random(len(box)) < 0.1):
            corner = random.uniform(0, [camera.width - 151, camera.height - 151])
            box[row] = [*corner, *(corner + random.uniform(20, 150, 2))]
        wrong = random.random(len(ids)) < 0.1
        ids[wrong] = random.choice(names, wrong.sum())
        misled.append((motion, StepBoxes(box, ids)))
    clean, _ = errors(camera, given, truth)
    before, after = errors(camera, misled, truth)
    assert max(before, after) <= 2 * clean
