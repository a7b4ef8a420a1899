"""What is wrong with odometry beside its noise, and what its covariance says of it."""

import numpy as np
import pytest

from dqslam import _core, load_scenario, simulate
from dqslam._core import PoseModel

PAPER, ORBIT = load_scenario("paper"), load_scenario("orbit")


def changed(scenario=PAPER, **values):
    odometry = type(scenario.odometry).model_validate(scenario.odometry.model_dump() | values)
    return scenario.model_copy(update={"odometry": odometry})


def recorded(scenario=PAPER, seed=0, **values):
    return simulate(changed(scenario, **values), seed=seed)


def errors(recording, truth):
    """Error of each step in the tangent at the true one."""
    model = truth.pose_model
    true = _core.between(model, truth.poses[:-1], truth.poses[1:])
    return _core.minus(model, recording.odometry.relative, true)


# --- sigmas --------------------------------------------------------------------------------------


@pytest.mark.parametrize("scenario", [PAPER, ORBIT])
def test_a_factor_scales_noise_and_covariance(scenario):
    once, truth = recorded(scenario)
    twice, _ = recorded(scenario, noise_factor=2.0)
    difference = twice.odometry.relative - once.odometry.relative
    if truth.pose_model == PoseModel.SE2:
        true = _core.between(PoseModel.SE2, truth.poses[:-1], truth.poses[1:])
        np.testing.assert_allclose(difference, once.odometry.relative - true, atol=1e-12)
    else:
        np.testing.assert_allclose(errors(twice, truth), 2.0 * errors(once, truth), atol=1e-9)
    determinant = np.linalg.det(twice.odometry.covariance) / np.linalg.det(once.odometry.covariance)
    np.testing.assert_allclose(determinant, 4.0 ** once.odometry.covariance.shape[1], rtol=1e-6)
    np.testing.assert_array_equal(once.detections.box, twice.detections.box)


@pytest.mark.parametrize("scenario", [PAPER, ORBIT])
def test_what_is_believed_may_differ_from_what_is_drawn(scenario):
    honest, _ = recorded(scenario)
    proud, _ = recorded(scenario, believed_factor=0.5)
    np.testing.assert_array_equal(honest.odometry.relative, proud.odometry.relative)
    np.testing.assert_allclose(proud.odometry.covariance, 0.25 * honest.odometry.covariance)


# --- what the covariance does not know -----------------------------------------------------------


@pytest.mark.parametrize(("scenario", "axes"), [(PAPER, 2), (ORBIT, 3)])
def test_a_wrong_scale_stretches_every_step(scenario, axes):
    right, _ = recorded(scenario)
    wrong, _ = recorded(scenario, scale_error=0.03)
    before, after = right.odometry.relative, wrong.odometry.relative
    np.testing.assert_allclose(after[:, :axes], 1.03 * before[:, :axes])
    np.testing.assert_array_equal(after[:, axes:], before[:, axes:])
    np.testing.assert_array_equal(right.odometry.covariance, wrong.odometry.covariance)


@pytest.mark.parametrize("scenario", [PAPER, ORBIT])
def test_a_gyroscope_drifts_about_the_vertical_axis(scenario):
    right, truth = recorded(scenario)
    wrong, _ = recorded(scenario, gyro_bias_rad_per_s=0.1)
    model = truth.pose_model
    turned = _core.minus(model, wrong.odometry.relative, right.odometry.relative)
    np.testing.assert_allclose(turned[:, -1], 0.1 * scenario.path.period_s, atol=1e-9)
    np.testing.assert_allclose(turned[:, :-1], 0.0, atol=1e-9)


def test_some_steps_slip():
    right, _ = recorded()
    slips = []
    for seed in range(20):
        right, _ = recorded(seed=seed)
        wrong, _ = recorded(seed=seed, slips={"share": 0.1, "excess": 0.5})
        stretch = wrong.odometry.relative[:, 0] / right.odometry.relative[:, 0]
        slipped = np.abs(stretch - 1.0) > 1e-9
        np.testing.assert_allclose(stretch[slipped], 1.5)
        np.testing.assert_array_equal(wrong.odometry.covariance, right.odometry.covariance)
        slips.append(slipped.mean())
    assert np.mean(slips) == pytest.approx(0.1, abs=0.015)  # of 5040 steps


@pytest.mark.parametrize("scenario", [PAPER, ORBIT])
def test_odometry_jumps_as_often_and_as_far_as_it_says(scenario):
    far = []
    for seed in range(30):
        right, truth = recorded(scenario, seed)
        jumps = {"count": 5, "translation_sigma_m": 2.0, "rotation_sigma_rad": 0.3}
        wrong, _ = recorded(scenario, seed, jumps=jumps)
        error = _core.minus(truth.pose_model, wrong.odometry.relative, right.odometry.relative)
        jumped = np.abs(error).max(axis=1) > 1e-9
        assert jumped.sum() == 5
        np.testing.assert_array_equal(wrong.odometry.covariance, right.odometry.covariance)
        far.append(error[jumped])
    far = np.vstack(far)
    axes = 2 if scenario is PAPER else 3
    assert np.sqrt((far[:, :axes] ** 2).mean()) == pytest.approx(2.0, rel=0.15)
    assert np.sqrt((far[:, axes:] ** 2).mean()) == pytest.approx(0.3, rel=0.15)


def test_more_jumps_than_steps_are_refused():
    jumps = {"count": 1000, "translation_sigma_m": 1.0, "rotation_sigma_rad": 0.1}
    with pytest.raises(ValueError, match=r"odometry\.jumps\.count: 1000 jumps in 252 steps"):
        recorded(jumps=jumps)


# --- gaps ----------------------------------------------------------------------------------------


def gaps(*starts, duration=10.0):
    return {
        "starts_s": starts,
        "duration_s": duration,
        "translation_sigma_m": 2.0,
        "rotation_sigma_rad": 0.5,
    }


def test_a_gap_has_no_poses_and_no_boxes():
    whole, truth = recorded()
    broken, seen = recorded(gaps=gaps(63.0))
    kept = np.r_[0:64, 73:253]
    np.testing.assert_array_equal(broken.timestamps, whole.timestamps[kept])
    np.testing.assert_array_equal(seen.poses, truth.poses[kept])
    there = np.isin(whole.detections.pose, kept)
    assert 0 < there.sum() < len(there)
    np.testing.assert_array_equal(broken.detections.box, whole.detections.box[there])
    np.testing.assert_array_equal(kept[broken.detections.pose], whole.detections.pose[there])
    np.testing.assert_array_equal(seen.box_object_id, truth.box_object_id[there])
    others = np.r_[0:63, 73:252]  # steps
    mine = np.r_[0:63, 64:243]
    np.testing.assert_array_equal(broken.odometry.relative[mine], whole.odometry.relative[others])
    pairs = set(zip(broken.positions.pose.tolist(), broken.positions.object_id, strict=True))
    assert pairs == set(zip(broken.detections.pose.tolist(), seen.box_object_id, strict=True))


@pytest.mark.parametrize(("scenario", "start"), [(PAPER, 63.0), (ORBIT, 9.0)])
def test_the_step_across_a_gap_is_as_uncertain_as_it_says(scenario, start):
    squares = []
    for seed in range(100):
        recording, truth = recorded(scenario, seed, gaps=gaps(start))
        step = int(np.argmax(np.diff(recording.timestamps)))
        assert np.diff(recording.timestamps)[step] == pytest.approx(10.0)
        covariance = recording.odometry.covariance[step]
        squares.append(errors(recording, truth)[step] ** 2 / np.diag(covariance))
        np.testing.assert_allclose(np.sqrt(np.diag(covariance))[[0, -1]], [2.0, 0.5])
    # Chi-squares over their degrees of freedom: 300 or 600 of them, standard error 8 or 6 %.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)


def test_a_gap_of_no_time_is_a_weak_link():
    whole, truth = recorded()
    weak, same = recorded(gaps=gaps(40.0, 100.0, duration=0.0))
    np.testing.assert_array_equal(same.poses, truth.poses)
    np.testing.assert_array_equal(whole.detections.box, weak.detections.box)
    changed_steps = np.flatnonzero(
        (whole.odometry.covariance != weak.odometry.covariance).any(axis=(1, 2))
    )
    np.testing.assert_array_equal(changed_steps, [40, 100])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (gaps(63.0, 70.0), r"starts_s: gaps overlap or do not ascend"),
        (gaps(70.0, 63.0), r"starts_s: gaps overlap or do not ascend"),
        (gaps(252.0), r"starts_s: a gap starts at the end"),
        (gaps(250.0), r"duration_s: a gap outlasts the recording"),
    ],
)
def test_impossible_gaps_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        recorded(gaps=given)


def test_a_gap_in_which_all_boxes_are_lost_is_refused():
    far = PAPER.detector.model_copy(update={"min_side_px": 300.0})
    scenario = PAPER.model_copy(update={"detector": far})
    boxes = simulate(scenario, seed=0)[0].detections
    assert len(boxes) > 0
    assert boxes.pose.min() > 0
    assert boxes.pose.max() < 252
    with pytest.raises(ValueError, match=r"odometry\.gaps: no box is left"):
        recorded(scenario, gaps=gaps(0.0, duration=252.0))
