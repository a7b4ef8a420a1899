"""The pose model of a session: given, or told by the first pose or the first motion."""

import numpy as np
import pytest

import dqslam as dq
from dqslam import Motion, OnlineSlam, PoseModel, StepBoxes, StepError

CAMERA = dq.Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
BOXES = StepBoxes(box=[[300.0, 200.0, 340.0, 260.0]], object_id=[4], class_name=["cup"])
AHEAD = Motion([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], 1e-4 * np.eye(6))
AHEAD_IN_PLANE = Motion([0.1, 0.0, 0.0], 1e-4 * np.eye(3))


def filled(slam, motion):
    slam.add(None, BOXES, timestamp=5.0)
    slam.add(motion, BOXES)
    return slam


def test_the_first_motion_tells_the_pose_model():
    slam = filled(OnlineSlam(CAMERA), AHEAD)
    asked = filled(OnlineSlam(CAMERA, pose_model=PoseModel.SE3), AHEAD)
    assert slam.pose_model == PoseModel.SE3
    assert slam.pose.shape == (7,)
    assert slam.timestamps.tolist() == [5.0, 6.0]
    assert slam.estimate().poses.tobytes() == asked.estimate().poses.tobytes()
    assert slam.objects.ellipsoids.tobytes() == asked.objects.ellipsoids.tobytes()
    assert slam.objects.observations.tolist() == [2]
    assert filled(OnlineSlam(CAMERA), AHEAD_IN_PLANE).pose_model == PoseModel.SE2


def test_other_arguments_of_a_session_are_kept():
    options = {"size_prior": dq.SizePrior(log_mean=-1.0), "trust_ids": 0.9, "estimates_noise": True}
    slam = filled(OnlineSlam(CAMERA, **options), AHEAD)
    assert slam.size_prior == options["size_prior"]
    assert slam.odometry_noise == dq.OdometryNoise()


def test_the_first_pose_tells_the_pose_model():
    slam = OnlineSlam(CAMERA, first_pose=[1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
    assert slam.pose_model == PoseModel.SE3
    slam.add(None, BOXES)
    np.testing.assert_array_equal(slam.pose, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
    with pytest.raises(ValueError, match=r"first_pose: expected 3 \(SE2\) or 7 \(SE3\) numbers"):
        OnlineSlam(CAMERA, first_pose=[1.0, 2.0, 3.0, 0.0])


def test_a_pose_model_that_is_given_is_checked():
    with pytest.raises(ValueError, match=r"first_pose: expected shape \(n, 3\), got \(1, 7\)"):
        OnlineSlam(CAMERA, pose_model=PoseModel.SE2, first_pose=[0, 0, 0, 0, 0, 0, 1])
    slam = OnlineSlam(CAMERA, pose_model=PoseModel.SE2)
    slam.add(None, BOXES)
    with pytest.raises(StepError, match="step 1: .*3"):
        slam.add(AHEAD, BOXES)
    assert (slam.pose_model, len(slam)) == (PoseModel.SE2, 1)


def test_the_model_is_settled_by_the_first_motion_alone():
    slam = filled(OnlineSlam(CAMERA), AHEAD_IN_PLANE)
    with pytest.raises(StepError, match="step 2"):
        slam.add(AHEAD, BOXES)
    slam = OnlineSlam(CAMERA)
    with pytest.raises(StepError, match="step 0"):
        slam.add(AHEAD, BOXES)  # the first step has none
    assert filled(slam, AHEAD).pose_model == PoseModel.SE3


def test_a_recording_in_space_needs_no_keyword(orbit):
    slam = OnlineSlam(orbit.camera)
    for step in dq.steps_of(orbit):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        if len(slam) == 3:
            break
    assert repr(slam) == "OnlineSlam(SE3, 3 steps, 8 objects)"


@pytest.fixture(scope="module")
def orbit():
    return dq.simulate(dq.load_scenario("orbit"), seed=1)[0]


def test_what_is_no_step():
    step = dq.Step(0.0, None, BOXES)
    message = r"OnlineSlam.add needs a Motion, not a Step: slam.add\(step.odometry, step.boxes"
    with pytest.raises(TypeError, match=message):
        OnlineSlam(CAMERA).add(step)
    with pytest.raises(TypeError, match="OnlineSlam.add needs a StepBoxes, not a list"):
        OnlineSlam(CAMERA).add(None, [[300.0, 200.0, 340.0, 260.0]])
    with pytest.raises(TypeError, match="OnlineSlam needs a Camera, not a str"):
        OnlineSlam("camera.json")
