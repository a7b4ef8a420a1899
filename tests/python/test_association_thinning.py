import numpy as np
import pytest

from dqslam import Detections, Odometry, PoseModel, Recording, _core
from dqslam.association.thinning import fill_in, thin_recording
from dqslam.recording.odometry import compose_covariance
from scenes import CAMERA

MODELS = [PoseModel.SE2, PoseModel.SE3]
TANGENT = {PoseModel.SE2: 3, PoseModel.SE3: 6}


def path(model, relative, covariance=None):
    """Return a recording with these steps and a box at every pose."""
    count = len(relative) + 1
    first = np.zeros(3) if model == PoseModel.SE2 else np.eye(7)[6]
    k = TANGENT[model]
    if covariance is None:
        covariance = np.tile(0.01 * np.eye(k), (len(relative), 1, 1))
    detections = Detections(
        pose=np.arange(count),
        box=np.tile([10.0, 20.0, 50.0, 60.0], (count, 1)) + np.arange(count)[:, None],
        score=np.ones(count),
        class_id=np.ones(count, dtype=int),
        object_id=np.arange(count),
        class_names={1: "cup"},
    )
    odometry = Odometry(model, first, relative, covariance)
    return Recording(CAMERA, np.arange(count), odometry, detections)


def winding(model, count, seed=0):
    """Return steps that turn and rise, shape (count, d)."""
    tangent = np.random.default_rng(seed).normal(0.0, 0.3, (count, TANGENT[model]))
    tangent[:, 0] += 1.0
    start = np.zeros((count, 3)) if model == PoseModel.SE2 else np.tile(np.eye(7)[6], (count, 1))
    return _core.plus(model, start, tangent)


def dead_reckoned(recording):
    odometry = recording.odometry
    return _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)


def test_noise_of_a_straight_path_by_hand():
    """Each turn moves what follows sideways: by 3, 2, 1, 0 m for the four steps of 1 m."""
    t, r = 0.1, 0.02
    steps = np.tile([1.0, 0.0, 0.0], (8, 1))
    each = np.tile(np.diag([t**2, t**2, r**2]), (8, 1, 1))
    thin = thin_recording(path(PoseModel.SE2, steps, each), np.array([0, 4, 8]))
    expected = [
        [4 * t**2, 0, 0],
        [0, 4 * t**2 + (9 + 4 + 1) * r**2, (3 + 2 + 1) * r**2],
        [0, (3 + 2 + 1) * r**2, 4 * r**2],
    ]
    np.testing.assert_allclose(thin.odometry.covariance, [expected] * 2, atol=1e-15)
    np.testing.assert_allclose(thin.odometry.relative, [[4.0, 0.0, 0.0]] * 2, atol=1e-15)


@pytest.mark.parametrize("model", MODELS)
def test_composed_covariance_is_that_of_simulated_noise(model):
    k, samples = TANGENT[model], 4000
    relative = winding(model, 6)
    random = np.random.default_rng(2)
    root = 0.01 * random.normal(size=(6, k, k))
    covariance = root @ root.transpose(0, 2, 1) + 1e-6 * np.eye(k)
    odometry = path(model, relative, covariance).odometry
    composed = compose_covariance(odometry, covariance, np.array([0, 4, 6]))
    for first, last, expected in ((0, 4, composed[0]), (4, 6, composed[1])):
        noisy = exact = None
        for step in range(first, last):
            here = np.repeat(relative[step : step + 1], samples, axis=0)
            error = random.multivariate_normal(np.zeros(k), covariance[step], samples)
            moved = _core.plus(model, here, error)
            noisy = moved if noisy is None else _core.compose(model, noisy, moved)
            exact = here if exact is None else _core.compose(model, exact, here)
        sampled = np.cov(_core.minus(model, noisy, exact).T)
        # In sigmas of the expected covariance it is the unit matrix, to 1 / sqrt(samples).
        whiten = np.linalg.inv(np.linalg.cholesky(expected))
        np.testing.assert_allclose(whiten @ sampled @ whiten.T, np.eye(k), atol=0.1)


@pytest.mark.parametrize("model", MODELS)
def test_a_thin_recording_keeps_the_path_and_the_boxes_of_its_poses(model):
    recording = path(model, winding(model, 11))
    keyframes = np.array([0, 3, 4, 9])
    thin = thin_recording(recording, keyframes)
    np.testing.assert_array_equal(thin.timestamps, keyframes)
    np.testing.assert_array_equal(thin.detections.pose, range(4))
    np.testing.assert_array_equal(thin.detections.object_id, keyframes)
    np.testing.assert_allclose(dead_reckoned(thin), dead_reckoned(recording)[keyframes], atol=1e-12)


def test_one_keyframe_is_a_recording_without_steps():
    thin = thin_recording(path(PoseModel.SE3, winding(PoseModel.SE3, 5)), np.array([0]))
    assert thin.odometry.relative.shape == (0, 7)
    assert thin.odometry.covariance.shape == (0, 6, 6)


@pytest.mark.parametrize("model", MODELS)
def test_filled_poses_meet_the_keyframes_wherever_they_are(model):
    recording = path(model, winding(model, 11))
    keyframes = np.array([0, 3, 4, 9])
    key_poses = winding(model, 4, seed=5)
    filled = fill_in(recording, keyframes, key_poses)
    np.testing.assert_allclose(filled[keyframes], key_poses, atol=1e-12)
    # After the last keyframe, odometry goes on from there.
    last = filled[9:11], filled[10:]
    np.testing.assert_allclose(
        _core.between(model, *last), recording.odometry.relative[9:], atol=1e-12
    )


@pytest.mark.parametrize("model", MODELS)
def test_filled_poses_are_true_when_odometry_is(model):
    recording = path(model, winding(model, 11))
    true = dead_reckoned(recording)
    keyframes = np.array([0, 3, 4, 9])
    np.testing.assert_allclose(fill_in(recording, keyframes, true[keyframes]), true, atol=1e-9)


def test_an_error_between_keyframes_is_shared_evenly():
    """The second keyframe is 0.4 m further to the side than odometry says, after four steps."""
    recording = path(PoseModel.SE2, np.tile([1.0, 0.0, 0.0], (4, 1)))
    filled = fill_in(recording, np.array([0, 4]), np.array([[0.0, 0.0, 0.0], [4.0, 0.4, 0.0]]))
    np.testing.assert_allclose(filled[:, 1], [0.0, 0.1, 0.2, 0.3, 0.4], atol=1e-12)
    np.testing.assert_allclose(filled[:, 0], range(5), atol=1e-12)
