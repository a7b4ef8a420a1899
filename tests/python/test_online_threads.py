"""One session in several threads: nothing is lost, and readers see whole steps."""

import sys
import threading

import numpy as np
import pytest

import dqslam as dq
from dqslam import Motion, OnlineSlam, StepBoxes

CAMERA = dq.Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
STEP = Motion([0.1, 0.0, 0.0], 1e-4 * np.eye(3))


@pytest.fixture(autouse=True)
def frequent_switches():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def in_threads(*works):
    """Run functions at the same time; raise the first error of any."""
    errors = []

    def caught(work):
        try:
            work()
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=caught, args=(work,), daemon=True) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=120)
        assert not thread.is_alive(), "a thread waits forever"
    if errors:
        raise errors[0]


def boxes(number):
    """Return a box of each of two objects; the number of the step moves them a little."""
    left = np.array([300.0, 200.0, 340.0, 260.0]) - number % 7
    return StepBoxes([left, left + 100.0], [1, 2])


@pytest.mark.parametrize("with_ids", [True, False])
def test_two_threads_add(with_ids):
    slam = OnlineSlam(CAMERA, pose_model=dq.PoseModel.SE2)
    slam.add(None)

    def add():
        for number in range(150):
            given = boxes(number)
            if not with_ids:
                given = StepBoxes(given.box, [-1, -1])
            slam.add(STEP, given)

    in_threads(add, add, add)
    assert len(slam) == 451
    assert slam.timestamps.tolist() == list(range(451))
    assert slam.poses.shape == (451, 3)
    assert sum(map(len, slam.assignments)) == 900
    if with_ids:
        assert slam.objects.observations.tolist() == [450, 450]
    assert np.isfinite(slam.poses).all()


def test_readers_see_whole_steps(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=3)
    steps = list(dq.steps_of(recording))
    slam = OnlineSlam(recording.camera, first_pose=recording.odometry.first_pose)
    slam.add(None, steps[0].boxes, timestamp=steps[0].timestamp)
    is_done = threading.Event()

    def add():
        try:
            for step in steps[1:]:
                slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        finally:
            is_done.set()

    def read():
        while not is_done.is_set():
            estimate = slam.estimate()
            assert len(estimate.timestamps) == len(estimate.poses) == len(estimate.initial_poses)
            assert len(estimate.object_ids) == len(estimate.ellipsoids)
            assert np.isfinite(estimate.poses).all()
            objects = slam.objects
            assert len(objects.object_ids) == len(objects.ellipsoids) == len(objects.class_names)
            assert len(slam.assignments) <= len(slam)
            repr(slam)

    def polish_and_save():
        for number in range(3):
            slam.polish(background=number % 2 == 0).result()
            slam.save(tmp_path / "map")
            found = dq.load_results(tmp_path / "map")
            assert len(found.poses) == len(found.timestamps)

    in_threads(add, read, read, polish_and_save)
    assert len(slam) == len(steps)
    alone = OnlineSlam(recording.camera, first_pose=recording.odometry.first_pose)
    for step in steps:
        alone.add(step.odometry, step.boxes, timestamp=step.timestamp)
    # Polishes came in between, at times that depend on the machine: at the end it is the same.
    costs = [one.polish().result().cost for one in (slam, alone)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-5)


def test_polishes_of_several_threads_wait_for_each_other():
    slam = OnlineSlam(CAMERA, pose_model=dq.PoseModel.SE2)
    slam.add(None)
    for number in range(20):
        slam.add(STEP, boxes(number))
    found = []
    works = [lambda: found.append(slam.polish().result()) for _ in range(4)]
    works.append(lambda: [slam.add(STEP, boxes(number)) for number in range(30)])
    works.append(lambda: found.append(slam.polish(background=True).result()))
    in_threads(*works)
    assert len(slam) == 51
    assert len(found) == 5
    assert all(np.isfinite(one.cost) for one in found)


def test_a_polish_that_fails_does_not_stop_the_session(monkeypatch):
    slam = OnlineSlam(CAMERA, pose_model=dq.PoseModel.SE2)
    slam.add(None)
    slam.add(STEP, boxes(0))

    def fails(*_):
        raise RuntimeError("no minimum")

    monkeypatch.setattr("dqslam.online.polish._core.solve", fails)
    work = slam.polish(background=True)
    with pytest.raises(RuntimeError, match="no minimum"):
        work.result()
    slam.add(STEP, boxes(1))
    with pytest.raises(RuntimeError, match="no minimum"):
        slam.polish()
    monkeypatch.undo()
    slam.add(STEP, boxes(2))
    assert len(slam) == 4
    assert np.isfinite(slam.polish().result().cost)


def test_what_is_read_is_the_readers():
    slam = OnlineSlam(CAMERA, pose_model=dq.PoseModel.SE2)
    slam.add(None, boxes(0))
    slam.shown[:] = 77
    slam.assignments[0][:] = 77
    assert slam.shown.tolist() == [1, 2]
    assert slam.assignments[0].tolist() == [1, 2]


def test_arrays_of_the_first_image_may_be_used_again():
    """A detector writes each image's boxes into the same array; the pose model comes later."""
    buffer = np.array([[300.0, 200.0, 340.0, 260.0]])
    slam = OnlineSlam(CAMERA)
    slam.add(None, StepBoxes(buffer, [4]))
    buffer[:] = [[100.0, 100.0, 110.0, 110.0]]
    motion = Motion([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], 1e-4 * np.eye(6))
    slam.add(motion, StepBoxes([[300.0, 200.0, 340.0, 260.0]], [4]))
    other = OnlineSlam(CAMERA, pose_model=dq.PoseModel.SE3)
    other.add(None, StepBoxes([[300.0, 200.0, 340.0, 260.0]], [4]))
    other.add(motion, StepBoxes([[300.0, 200.0, 340.0, 260.0]], [4]))
    assert slam.objects.ellipsoids.tobytes() == other.objects.ellipsoids.tobytes()
