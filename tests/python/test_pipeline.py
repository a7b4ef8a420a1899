"""Recordings from files to a trajectory and a map."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import OdometryNoise, SizePrior, SizePriors
from dqslam.io import Trajectory, load_recording
from dqslam.metrics import absolute_trajectory_error, center_errors
from dqslam.pipeline import perturb_odometry, run
from dqslam.recording import RelativePositions
from orbit import NAMES

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


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
    believed = perturb_odometry(recording, NOISE, seed=1, believed=OdometryNoise(0.5, 0.1))
    np.testing.assert_array_equal(believed.odometry.relative, first.odometry.relative)
    np.testing.assert_allclose(believed.odometry.covariance[0, 0, 0], 0.25)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_slam_beats_its_odometry(files, orbit, seed):
    recording, _ = load_recording(*files)
    truth = Trajectory(orbit.times, orbit.poses)
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
    result = run(recording, mode=_core.Mode.MAPPING)
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-12)
    true_centers = np.array([orbit.centers[name] for name in NAMES])
    assert np.linalg.norm(result.estimate.centers - true_centers, axis=1).max() < 0.01
    assert result.report["trajectory_error"] is None
    assert result.report["mode"] == "mapping"


def test_size_priors_of_classes_are_reported_and_checked(files):
    recording, _ = load_recording(*files)
    broad = SizePrior(np.log(0.1), 0.7)
    result = run(recording, size_prior=SizePriors({"cup": SizePrior(np.log(0.05), 0.2)}, broad))
    assert result.report["size_prior"]["classes"]["cup"]["median_m"] == pytest.approx(0.05)
    assert result.report["dropped_objects"] == {}
    with pytest.raises(ValueError, match=r"no class 'sofa' in the recording, only: .*cup"):
        run(recording, size_prior=SizePriors({"sofa": broad}))


def test_relative_positions_take_no_part(files):
    recording, _ = load_recording(*files)
    wrong = RelativePositions([5], [101], [[0.0, 0.0, 50.0]], [1e-6 * np.eye(3)])
    with_them = run(replace(recording, positions=wrong)).estimate
    np.testing.assert_array_equal(with_them.poses, run(recording).estimate.poses)


def test_boxes_without_ids_give_the_same_map(files, orbit):
    recording, dropped = load_recording(*files, ids="none")
    assert dropped.total == 0
    assert np.all(recording.detections.object_id == -1)
    truth = Trajectory(orbit.times, orbit.poses)
    noisy = perturb_odometry(recording, NOISE, seed=1)
    result = run(noisy, trust_ids=0.9, reference=truth)
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert [entry["observations"] for entry in result.report["objects"]] == [40] * 4
    np.testing.assert_array_equal(result.estimate.object_ids, range(4))
    assert sorted(result.estimate.class_names) == sorted(NAMES.values())


def test_without_ids_the_odometry_may_be_the_truth(files, orbit):
    recording, _ = load_recording(*files, ids="none")
    result = run(recording, trust_ids=0.9, mode=_core.Mode.MAPPING, estimates_noise=True)
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-9)
    assert result.report["odometry_noise"] == {"from": "given"}
    centers = {
        name: place for name, place in zip(NAMES.values(), orbit.centers.values(), strict=True)
    }
    for name, center in zip(result.estimate.class_names, result.estimate.centers, strict=True):
        np.testing.assert_allclose(center, centers[name], atol=0.01)


def test_the_noise_of_odometry_is_told_when_it_is_estimated(files):
    recording, _ = load_recording(*files)
    noise = run(perturb_odometry(recording, NOISE, seed=0), estimates_noise=True).report
    noise = noise["odometry_noise"]
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
