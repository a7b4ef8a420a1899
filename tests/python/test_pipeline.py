"""Recordings from files to a trajectory and a map."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.io import Trajectory, load_recording
from dqslam.metrics import absolute_trajectory_error, center_errors
from dqslam.pipeline import RunOptions, run
from dqslam.recording import Recording, RelativePositions
from dqslam.simulation import load_scenario, perturb_odometry, simulate
from orbit import NAMES

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


def trajectory(orbit):
    return Trajectory(orbit.times, orbit.poses)


def test_perturbation_has_the_sigmas_it_says(files):
    recording, _ = load_recording(*files)
    odometry = recording.odometry
    tangents = np.concatenate(
        [
            _core.minus(
                odometry.pose_model,
                perturb_odometry(recording, NOISE, seed=seed).odometry.relative,
                odometry.relative,
            )
            for seed in range(100)
        ]
    )
    # 3900 samples: 1.1 % standard error of a sigma.
    np.testing.assert_allclose(tangents.std(axis=0), [0.01] * 6, rtol=0.05)
    np.testing.assert_allclose(tangents.mean(axis=0), 0, atol=6e-4)


def test_perturbation_is_repeatable_and_starts_at_the_same_pose(files):
    recording, _ = load_recording(*files)
    first, again, other = (perturb_odometry(recording, NOISE, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.odometry.relative, again.odometry.relative)
    assert not np.array_equal(first.odometry.relative, other.odometry.relative)
    np.testing.assert_array_equal(first.odometry.first_pose, recording.odometry.first_pose)
    np.testing.assert_allclose(first.odometry.covariance[0], np.eye(6) * 1e-4)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_slam_beats_its_odometry(files, orbit, seed):
    recording, _ = load_recording(*files)
    truth = trajectory(orbit)
    result = run(perturb_odometry(recording, NOISE, seed=seed), reference=truth)
    error = result.report["trajectory_error"]
    assert error["poses"] == len(orbit.times)
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert error["after"]["ate_rmse_m"] < 0.02
    aligned = absolute_trajectory_error(result.estimate.poses[:, :3], orbit.poses[:, :3])
    assert error["after"]["ate_rmse_m"] == pytest.approx(aligned.rmse)
    true_centers = np.array([orbit.centers[name] for name in NAMES])
    assert center_errors(result.estimate.centers, true_centers, aligned.alignment).max() < 0.02
    boxes = result.report["boxes"]
    assert boxes["count"] == 160
    assert boxes["outlier_share"] == 0
    assert [entry["class_name"] for entry in result.report["objects"]] == list(NAMES.values())


def test_same_seed_same_bits(files):
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=3)
    one, two = run(noisy), run(noisy)
    np.testing.assert_array_equal(one.estimate.poses, two.estimate.poses)
    np.testing.assert_array_equal(one.estimate.ellipsoids, two.estimate.ellipsoids)


def test_mapping_leaves_the_path_alone(files, orbit):
    recording, _ = load_recording(*files)
    result = run(recording, RunOptions(mode=_core.Mode.MAPPING))
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-12)
    true_centers = np.array([orbit.centers[name] for name in NAMES])
    assert np.linalg.norm(result.estimate.centers - true_centers, axis=1).max() < 0.01
    assert result.report["trajectory_error"] is None
    assert result.report["mode"] == "mapping"


@pytest.mark.parametrize("online", [False, True])
def test_size_priors_of_classes_are_reported_and_checked(files, online):
    recording, _ = load_recording(*files)
    broad = SizePrior(np.log(0.1), 0.7)
    sizes = SizePriors({"cup": SizePrior(np.log(0.05), 0.2)}, broad)
    result = run(recording, RunOptions(size_prior=sizes), online=online)
    assert result.report["size_prior"]["classes"]["cup"]["median_m"] == pytest.approx(0.05)
    assert result.report["dropped_objects"] == {}
    with pytest.raises(ValueError, match=r"no class 'sofa' in the recording, only: .*cup"):
        run(recording, RunOptions(size_prior=SizePriors({"sofa": broad})), online=online)


@pytest.mark.parametrize("online", [False, True])
def test_relative_positions_take_part_with_final_ids_only(files, online):
    recording, _ = load_recording(*files)
    wrong = RelativePositions([5], [101], [[0.0, 0.0, 50.0]], [1e-6 * np.eye(3)])
    told = replace(recording, positions=wrong)
    plain = run(recording, online=online).estimate
    moved = run(told, online=online).estimate
    assert np.abs(moved.poses - plain.poses).max() > 0.01  # it is wrong by meters
    doubtful = RunOptions(trust_ids=0.9)
    without = run(told, doubtful, online=online)
    assert "positions took no part: the ids of boxes must be final" in str(
        without.report["warnings"]
    )
    plain = run(recording, doubtful, online=online).estimate
    np.testing.assert_array_equal(without.estimate.poses, plain.poses)


def test_boxes_without_ids_give_the_same_map(files, orbit):
    recording, dropped = load_recording(*files, ids="none")
    assert dropped.total == 0
    assert np.all(recording.detections.object_id == -1)
    truth = trajectory(orbit)
    noisy = perturb_odometry(recording, NOISE, seed=1)
    result = run(noisy, reference=truth)
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert [entry["observations"] for entry in result.report["objects"]] == [40] * 4
    np.testing.assert_array_equal(result.estimate.object_ids, range(4))
    assert sorted(result.estimate.class_names) == sorted(NAMES.values())


def test_without_ids_the_odometry_may_be_the_truth(files, orbit):
    recording, _ = load_recording(*files, ids="none")
    result = run(recording, RunOptions(mode=_core.Mode.MAPPING, estimates_noise=True))
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-9)
    assert result.report["odometry_noise"] == {"from": "given"}
    centers = {
        name: place for name, place in zip(NAMES.values(), orbit.centers.values(), strict=True)
    }
    for name, center in zip(result.estimate.class_names, result.estimate.centers, strict=True):
        np.testing.assert_allclose(center, centers[name], atol=0.01)


def test_the_noise_of_odometry_is_told_when_it_is_estimated(files):
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=0)
    noise = run(noisy, RunOptions(estimates_noise=True)).report["odometry_noise"]
    assert noise["from"] == "estimated"
    assert noise["translation_m"] == pytest.approx(0.01, rel=0.5)
    assert noise["rotation_rad"] == pytest.approx(0.01, rel=0.5)


def test_ids_may_be_any_number(files):
    recording, _ = load_recording(*files)
    detections = recording.detections
    large = replace(detections, object_id=detections.object_id + 10**15)
    estimate = run(replace(recording, detections=large)).estimate
    np.testing.assert_array_equal(estimate.object_ids - 10**15, [101, 102, 105, 109])
    np.testing.assert_array_equal(estimate.observations, [40] * 4)


@pytest.mark.parametrize("trust", [1.0, 0.9])
def test_step_by_step_it_comes_to_the_same(files, orbit, trust):
    """A session that is polished ends where the estimate of all at once does: a millimeter.

    With the noise of boxes given: without, an estimate at once finds out what of it repeats.
    """
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=0)
    given = BoxNoise()
    options = RunOptions(trust_ids=trust, hold_out=0.1, seed=2, box_noise=given)
    truth = trajectory(orbit)
    batch, online = (run(noisy, options, online=way, reference=truth) for way in (False, True))
    np.testing.assert_array_equal(online.held_out, batch.held_out)
    np.testing.assert_array_equal(online.detections.truncated, batch.detections.truncated)
    np.testing.assert_allclose(online.estimate.poses, batch.estimate.poses, atol=2e-3)
    named = np.column_stack([one.detections.object_id for one in (online, batch)])
    assert len(np.unique(named, axis=0)) == 4  # ids that are not final are numbered by each
    assert set(online.report) - set(batch.report) == {"online"}
    assert online.report["trajectory_error"]["before"] == batch.report["trajectory_error"]["before"]
    live = online.report["trajectory_error"]["live"]["ate_rmse_m"]
    assert live < 0.5 * batch.report["trajectory_error"]["before"]["ate_rmse_m"]


@pytest.mark.parametrize("online", [False, True])
def test_a_robot_on_the_plane(online):
    """The level of its noise is estimated in two axes and one angle."""
    whole, truth = simulate(load_scenario("paper"), seed=0)
    steps = 80
    seen = whole.detections.select(whole.detections.pose < steps)
    odometry = replace(
        whole.odometry,
        relative=whole.odometry.relative[: steps - 1],
        covariance=whole.odometry.covariance[: steps - 1],
    )
    recording = Recording(whole.camera, whole.timestamps[:steps], odometry, seen)
    result = run(recording, RunOptions(estimates_noise=True), online=online)
    assert result.report["odometry_noise"]["from"] == "estimated"
    assert result.marginals.poses.shape == (steps, 3, 3)
    before, after = (
        np.linalg.norm(poses[:, :2] - truth.poses[:steps, :2], axis=1).mean()
        for poses in (result.estimate.initial_poses, result.estimate.poses)
    )
    assert after < 0.5 * before


def test_a_session_improves_the_odometry_or_is_refused(files):
    recording, _ = load_recording(*files)
    with pytest.raises(ValueError, match="online: a session improves .*, it has no mode MAPPING"):
        run(recording, RunOptions(mode=_core.Mode.MAPPING), online=True)


@pytest.mark.parametrize("online", [False, True])
def test_a_reference_of_another_time_is_refused_before_the_work(files, orbit, online):
    recording, _ = load_recording(*files)
    later = Trajectory(orbit.times + 1000.0, orbit.poses)
    shares = []
    with pytest.raises(ValueError, match="groundtruth: 0 poses within 0.05 s of the estimate's"):
        run(
            recording,
            online=online,
            reference=later,
            progress=lambda share, text: shares.append(share),
        )
    assert shares == []


def test_progress_is_told_in_shares_and_of_a_session_in_words(files):
    recording, _ = load_recording(*files)
    told = {False: [], True: []}
    for online, calls in told.items():
        run(recording, online=online, progress=lambda *call, to=calls: to.append(call))
    for calls in told.values():
        shares = [share for share, _ in calls]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
    assert {text for _, text in told[False]} == {""}
    texts = [text for _, text in told[True]]
    assert len(texts) == 40
    assert texts[0].startswith("step 1: at 1.20 0.00 0.70 m, 0 objects, ")
    assert ", 4 objects, " in texts[-1]
