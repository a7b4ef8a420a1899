"""The session: what it estimates step by step, and that a bad step changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.problems import chain, paper

import dqslam as dq
from dqslam import Loss, SolveOptions, _core
from dqslam.assumptions import BoxNoise
from dqslam.graph import build_graph, solve
from dqslam.online import Motion, OnlineSlam, StepBoxes, StepError, StepPositions, replay, steps_of

NOISE = BoxNoise(pixels=1.0, relative=0.0)
STEP = Motion([0.25, 0.0, 0.0], np.diag([1e-4, 1e-5, 1e-4]))


@pytest.fixture(scope="module")
def problem():
    """Two laps of 260 poses around 10 objects, from clean odometry."""
    return chain(1, 10, 0, 0.1)


def session(problem, **given):
    return OnlineSlam(problem.recording.camera, box_noise=NOISE, **given)


def fed(problem, count=None, **given):
    slam = session(problem, **given)
    for step in list(steps_of(problem.recording))[:count]:
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    return slam


def rmse(poses, truth):
    return np.sqrt(np.mean(np.sum((poses - truth.poses)[:, :2] ** 2, axis=1)))


def bits(slam):
    return (
        slam.poses.tobytes(),
        slam.objects.ellipsoids.tobytes(),
        slam.objects.object_ids.tobytes(),
        slam.timestamps.tobytes(),
    )


def test_without_objects_it_is_dead_reckoning(problem):
    slam = session(problem)
    slam.add(None)
    for _ in range(3):
        slam.add(Motion([1.0, 0.0, np.pi / 2.0], np.eye(3)))
    # A square of 1 m, by hand.
    np.testing.assert_allclose(
        slam.poses,
        [[0, 0, 0], [1, 0, np.pi / 2], [1, 1, np.pi], [0, 1, 1.5 * np.pi]],
        atol=1e-12,
    )
    np.testing.assert_allclose(slam.timestamps, [0, 1, 2, 3])


def test_one_box_puts_a_sphere_where_its_size_says(problem):
    # 1500 px focal length: a sphere of radius 0.3 m whose tangents span 90 px about the axis.
    camera = problem.recording.camera
    slam = session(problem, size_prior=dq.SizePrior(np.log(0.3), 0.7))
    slam.add(None, StepBoxes([[594.5, 466.5, 684.5, 556.5]], [7]))
    objects = slam.objects
    assert objects.object_ids.tolist() == [7]
    assert objects.class_names == ("object",)
    # tan of half the angle is 0.03: depth radius / sin; the camera looks along +y, 1 m above.
    depth = 0.3 / np.sin(np.arctan(0.03))
    np.testing.assert_allclose(objects.centers, [[0.0, depth, 1.0]], atol=0.02)
    assert camera.fx == 1500.0


def test_a_polish_finds_what_solve_finds(problem):
    graph = build_graph(problem.recording, box_noise=NOISE, size_prior=dq.SizePrior())
    estimate, summary = solve(graph)
    slam = fed(problem)
    polished = slam.polish().result()
    assert polished.cost == pytest.approx(summary.final_cost, rel=1e-6)
    np.testing.assert_allclose(slam.poses, estimate.poses, atol=2e-3)
    found = slam.estimate()
    assert found.object_ids.tolist() == estimate.object_ids.tolist()
    assert found.observations.tolist() == estimate.observations.tolist()
    np.testing.assert_allclose(found.centers, estimate.centers, atol=5e-3)
    np.testing.assert_allclose(found.initial_poses, estimate.initial_poses, atol=1e-9)


def test_ranges_reach_a_session_as_they_reach_solve(problem):
    boxes, truth = problem.recording.detections, problem.truth
    name = int(boxes.object_id[0])
    poses = boxes.pose[boxes.object_id == name][[10, 20, 30]]
    center = truth.centers[np.flatnonzero(truth.object_ids == name)[0]]
    robots = np.column_stack([truth.poses[poses, :2], np.zeros(3)])
    ranges = dq.Measurements(
        "range",
        poses,
        np.full(3, name),
        np.linalg.norm(center - robots, axis=1)[:, None] + 0.1,  # too long, by five sigmas
        np.full((3, 1, 1), 0.02**2),
    )
    recording = replace(problem.recording, positions=None, measurements=(ranges,))
    plain = SolveOptions(loss=Loss.NONE)
    told = {"box_noise": NOISE, "size_prior": dq.SizePrior()}
    _, summary = solve(build_graph(recording, **told), plain)
    _, without = solve(build_graph(replace(recording, measurements=()), **told), plain)
    assert summary.final_cost > without.final_cost + 1.0
    slam = OnlineSlam(recording.camera, plain, box_noise=NOISE)
    assert len(list(replay(slam, recording))) == len(recording.timestamps)
    assert slam.polish().result().cost == pytest.approx(summary.final_cost, rel=1e-6)


def test_before_a_polish_it_is_nearly_as_good():
    before, after = [], []
    for seed in range(3):
        drawn = paper(seed, 1.0)
        slam = fed(drawn)
        before.append(rmse(slam.poses, drawn.truth))
        slam.polish()
        after.append(rmse(slam.poses, drawn.truth))
    assert np.mean(before) <= 1.5 * np.mean(after)
    assert np.mean(after) < 0.15


def test_the_window_does_not_decide_what_a_polish_finds(problem):
    costs = [
        fed(problem, 200, online=dq.OnlineOptions(window_poses=size)).polish().result().cost
        for size in (5, 10, 20)
    ]
    np.testing.assert_allclose(costs, costs[0], rtol=1e-6)


def test_it_does_not_depend_on_the_world_frame(problem):
    here = fed(problem, 150)
    start = np.array([3.0, -2.0, 1.0])
    there = fed(problem, 150, first_pose=start)
    moved = _core.compose(dq.PoseModel.SE2, np.repeat(start[None], 150, axis=0), here.poses)
    np.testing.assert_allclose(there.poses, moved, atol=1e-5)


def test_the_same_steps_give_the_same_bits(problem):
    assert bits(fed(problem, 100)) == bits(fed(problem, 100))


def test_a_step_does_bounded_work(problem):
    slam = session(problem)
    reports = [frame.report for frame in replay(slam, problem.recording)]
    boxes = np.bincount(problem.recording.detections.pose, minlength=len(reports))
    for report in reports[1:]:
        assert report.window_poses == min(report.pose, 10)
        seen = boxes[max(report.pose - 9, 0) : report.pose + 1].sum()
        own = sum(slam.objects.observations)
        assert report.linearized <= seen + own
    large = [report for report in reports if report.smoothed_poses > 64]
    assert len(large) <= len(reports) / 16  # young sessions do it sooner, later one of 128
    window = np.array([report.linearized for report in reports])
    assert np.median(window[260:]) <= 1.5 * np.median(window[130:260])  # no growth


def refused(slam, *given, **named):
    before = bits(slam)
    with pytest.raises(StepError) as error:
        slam.add(*given, **named)
    assert bits(slam) == before
    return str(error.value)


def test_a_bad_step_is_named_and_changes_nothing(problem):
    slam = fed(problem, 30)
    box = StepBoxes([[10.0, 10.0, 50.0, 60.0]], [3])
    assert refused(slam, None) == (
        "step 30: no odometry leads here; across a gap, give a guess and a covariance as wide"
    )
    assert refused(slam, STEP, box, timestamp=29.0) == (
        "step 30: timestamp 29.0 repeats the last one"
    )
    assert refused(slam, STEP, box, timestamp=12.0) == (
        "step 30: timestamp 12.0 is before the last, 29.0"
    )
    assert "timestamp nan is not finite" in refused(slam, STEP, timestamp=float("nan"))
    assert "odometry: expected 3 finite numbers" in refused(
        slam, Motion([np.nan, 0, 0], STEP.covariance)
    )
    assert "not symmetric positive definite" in refused(
        slam, Motion(STEP.relative, np.zeros((3, 3)))
    )
    assert "boxes row 1: inverted or empty box" in refused(
        slam, STEP, StepBoxes([[1, 1, 9, 9], [9, 1, 5, 9]], [0, 99])
    )
    assert "boxes row 0: NaN" in refused(slam, STEP, StepBoxes([[1, np.nan, 9, 9]], [99]))
    assert "object_id row 0" in refused(slam, STEP, StepBoxes([[1, 1, 9, 9]], [-2]))
    assert "class_name: expected 1 names" in refused(
        slam, STEP, StepBoxes([[1, 1, 9, 9]], [1], ["a", "b"])
    )
    assert "object 55 is not in the map yet" in refused(
        slam, STEP, positions=StepPositions([55], [[1, 0, 0]], [np.eye(3)])
    )
    # And on it goes, as if nothing had been.
    other = fed(problem, 30)
    step = list(steps_of(problem.recording))[30]
    slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    other.add(step.odometry, step.boxes, timestamp=step.timestamp)
    assert bits(slam) == bits(other)


def test_the_first_step_has_no_odometry(problem):
    slam = session(problem)
    assert "the first step has no odometry" in refused(slam, STEP)
    np.testing.assert_array_equal(slam.pose, np.zeros(3))
    assert len(slam) == 0 and len(slam.objects) == 0
    assert np.isnan(slam.polish().result().cost)  # nothing to do


def test_a_step_without_boxes_is_one(problem):
    slam = fed(problem, 30)
    last = slam.pose
    slam.add(STEP, StepBoxes(np.zeros((0, 4)), []))
    slam.add(STEP)
    assert len(slam) == 32
    np.testing.assert_allclose(np.hypot(*(slam.pose - last)[:2]), 0.5, atol=0.02)


def test_a_merged_polish_loses_nothing(problem):
    steps = list(steps_of(problem.recording))
    slam = fed(problem, 200)
    before = slam.poses
    work = slam.polish(background=True)
    work.result()
    polisher = slam._polisher
    polisher._polish, late = None, polisher._polish  # as if it were not done yet
    for step in steps[200:260]:
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    arrived = slam.poses
    between = _core.between(dq.PoseModel.SE2, arrived[199:200].repeat(60, 0), arrived[200:])
    polisher._polish = late
    polisher.take()
    merged = slam.poses
    assert len(merged) == 260 and len(before) == 200
    np.testing.assert_allclose(merged[:200], work.result().poses, atol=1e-12)
    # What came later stands to the last polished pose as it did.
    np.testing.assert_allclose(
        _core.between(dq.PoseModel.SE2, merged[199:200].repeat(60, 0), merged[200:]),
        between,
        atol=1e-9,
    )
    for step in steps[260:300]:
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    assert slam.objects.observations.sum() == sum(len(step.boxes.box) for step in steps[:300])
    assert slam.polish().result().cost == pytest.approx(
        fed(problem, 300).polish().result().cost, rel=1e-6
    )


def test_a_wrong_box_pulls_less_with_a_loss(problem):
    wrong = StepBoxes([[100.0, 100.0, 300.0, 300.0]], [0])
    errors = []
    for loss in (dq.Loss.NONE, dq.Loss.CAUCHY):
        slam = OnlineSlam(problem.recording.camera, dq.SolveOptions(loss=loss), box_noise=NOISE)
        steps = list(steps_of(problem.recording))[:120]
        for number, step in enumerate(steps):
            has_first = 0 in step.boxes.object_id
            boxes = wrong if number >= 60 and number % 5 == 0 and has_first else step.boxes
            slam.add(step.odometry, boxes)
        errors.append(np.abs(slam.poses - problem.truth.poses[:120]).max())
    assert errors[1] < 0.2
    assert errors[1] <= errors[0]


def test_each_level_of_smoothing_is_an_option(problem):
    options = dq.OnlineOptions(short_smoothing=dq.SmoothingLevel(20, 5, 2))
    options.medium_smoothing.every = 60
    assert options.medium_smoothing.every == 60
    reports = []
    slam = session(problem, online=options)
    for step in list(steps_of(problem.recording))[:200]:
        reports.append(slam.add(step.odometry, step.boxes))
    short = [report.pose + 1 for report in reports if report.smoothed_poses == 20]
    assert len(short) > 30  # now and then a longer one takes its place
    assert all(pose % 5 == 0 for pose in short)
    with pytest.raises(ValueError, match="all must be positive"):
        session(problem, online=dq.OnlineOptions(long_smoothing=dq.SmoothingLevel(0, 1, 1)))


def test_positions_place_an_object(problem):
    slam = session(problem)
    box = StepBoxes([[594.5, 466.5, 684.5, 556.5]], [7])
    slam.add(None, box)
    at = [0.2, 8.0, 1.1]
    slam.add(
        Motion([1e-3, 0, 0], 1e-8 * np.eye(3)),
        box,
        positions=StepPositions([7], [at], [1e-4 * np.eye(3)]),
    )
    for _ in range(5):
        slam.add(
            Motion([1e-3, 0, 0], 1e-8 * np.eye(3)),
            positions=StepPositions([7], [at], [1e-4 * np.eye(3)]),
        )
    np.testing.assert_allclose(slam.objects.centers[0], at, atol=0.1)


def test_in_se3_it_finds_what_solve_finds():
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=0)
    recording = replace(recording, positions=None)
    slam = OnlineSlam(
        recording.camera,
        pose_model=dq.PoseModel.SE3,
        first_pose=recording.odometry.first_pose,
    )
    assert len(list(replay(slam, recording))) == len(recording.timestamps)
    _, summary = solve(build_graph(recording, size_prior=dq.SizePrior()))
    assert slam.polish().result().cost == pytest.approx(summary.final_cost, rel=1e-6)
    np.testing.assert_allclose(np.linalg.norm(slam.poses[:, 3:], axis=1), 1.0, atol=1e-9)
