"""A large loop: the drive comes back to where it began, meters beside it by odometry."""

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.online import Motion, OnlineSlam, StepBoxes

SE2 = dq.PoseModel.SE2
NOISE = dq.BoxNoise(pixels=1.0, relative=0.0)
AROUND, BEYOND, RADIUS_M = 420, 60, 30.0
LEFT = [0.0, 0.0, 1.0, -np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
CAMERA = dq.Camera(1500.0, 1500.0, 639.5, 511.5, 1280, 1024, robot_from_camera=LEFT)


def ring(seed, noise=0.3, count=60):
    """Drive a circle once and a little more; 60 objects stand 5 to 9 m to the left of the path.

    Returns the true poses, the odometry with its covariances, and the boxes of each pose.
    """
    random = np.random.default_rng(seed)
    turn = 2.0 * np.pi / AROUND
    steps = np.tile([turn * RADIUS_M, 0.0, turn], (AROUND + BEYOND - 1, 1))
    truth = _core.dead_reckon(SE2, np.zeros(3), steps)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    apart = RADIUS_M - random.uniform(5.0, 9.0, count)
    height = random.uniform(0.6, 1.6, count)
    center = np.column_stack([apart * np.sin(angle), RADIUS_M - apart * np.cos(angle), height])
    things = np.array(
        [_core.ellipsoid_from_axes(c, [0.5, 0.4, 0.3], [0.0, 0.0, 0.0, 1.0]) for c in center]
    )
    sigma = np.array([0.02 * noise, 0.005, 0.02 * noise])
    measured = steps + random.normal(size=steps.shape) * sigma * [1.0, 0.0, 1.0]
    boxes = []
    for pose in truth:
        box, in_front = _core.project_to_boxes(SE2, CAMERA, np.tile(pose, (count, 1)), things)
        near = np.hypot(*(center - np.append(pose[:2], 0.0))[:, :2].T) < 15.0
        shown = in_front & near & (box >= -0.5).all(axis=1)
        shown &= (box[:, 2] <= 1279.5) & (box[:, 3] <= 1023.5)
        rows = np.flatnonzero(shown)
        boxes.append(StepBoxes(box[rows] + random.normal(size=(len(rows), 4)), rows))
    return truth, [Motion(one, np.diag(sigma**2)) for one in measured], boxes


@pytest.fixture(scope="module", params=[0, 1])
def drive(request):
    """The true poses, the session, its reports, and the error of the pose at each step."""
    truth, motions, boxes = ring(request.param)
    slam = OnlineSlam(CAMERA, box_noise=NOISE)
    reports, errors = [], []
    for number, boxes_here in enumerate(boxes):
        reports.append(slam.add(motions[number - 1] if number else None, boxes_here))
        errors.append(np.hypot(*(slam.pose - truth[number])[:2]))
    return truth, slam, reports, np.array(errors)


def test_coming_back_closes_the_loop(drive):
    truth, slam, reports, errors = drive
    closed = [report.pose for report in reports if report.closed_loop]
    assert 1 <= len(closed) <= 3
    assert all(AROUND - 20 <= pose <= AROUND + BEYOND for pose in closed)
    assert max(report.smoothed_poses for report in reports) >= AROUND - 30  # all of it was free
    before, after = errors[closed[0] - 5], np.median(errors[-20:])
    assert before > 1.0
    assert after < 0.2 * before
    path = slam.poses
    rmse = np.sqrt(np.mean(np.sum((path - truth)[:, :2] ** 2, axis=1)))
    slam.polish()
    polished = np.sqrt(np.mean(np.sum((slam.poses - truth)[:, :2] ** 2, axis=1)))
    assert rmse <= 1.5 * polished


def test_loops_are_rare(drive):
    _, _, reports, _ = drive
    large = [report for report in reports if report.smoothed_poses > 128]
    assert len(large) <= 0.03 * len(reports)
