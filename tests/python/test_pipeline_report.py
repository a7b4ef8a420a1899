"""What a report says of boxes, objects and the path."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import BoxNoise, OdometryNoise
from dqslam.io import Trajectory, load_recording
from dqslam.pipeline import RunOptions, run
from dqslam.pipeline.report import box_chi2, describe_evidence, warn_of_evidence
from dqslam.simulation import perturb_odometry
from orbit import make_orbit, write_orbit

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


def test_box_chi2_is_what_its_name_says(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, RunOptions(mode=_core.Mode.MAPPING)).estimate
    noise = BoxNoise(pixels=2.0, relative=0.0)
    detections = recording.detections
    row = int(np.searchsorted(estimate.object_ids, detections.object_id[5]))
    predicted, _ = _core.project_to_boxes(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose[5:6]],
        estimate.ellipsoids[row : row + 1],
    )
    expected = np.sum((predicted[0] - detections.box[5]) ** 2) / 4
    assert box_chi2(estimate, detections, noise)[5] == pytest.approx(expected)


def test_boxes_of_a_dropped_object_do_not_fit(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, RunOptions(mode=_core.Mode.MAPPING)).estimate
    part = replace(
        estimate,
        object_ids=estimate.object_ids[:-1],
        ellipsoids=estimate.ellipsoids[:-1],
        dual_quadrics=estimate.dual_quadrics[:-1],
    )
    chi2 = box_chi2(part, recording.detections, BoxNoise())
    is_last = recording.detections.object_id == estimate.object_ids[-1]
    np.testing.assert_array_equal(np.isinf(chi2), is_last)


def test_an_object_that_moves_shows_in_the_report(tmp_path):
    orbit = make_orbit(noise_px=1.0)
    for pose in range(20, 40):  # the lamp trades places with the book
        orbit.boxes[pose, 5] = orbit.boxes[pose, 2] + 0.5
    recording, _ = load_recording(*write_orbit(tmp_path, orbit))
    result = run(
        perturb_odometry(recording, NOISE, seed=0),
        reference=Trajectory(orbit.times, orbit.poses),
    )
    outliers = {entry["class_name"]: entry["outlier_share"] for entry in result.report["objects"]}
    assert outliers["lamp"] > 0.3
    assert max(share for name, share in outliers.items() if name != "lamp") < 0.05
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < error["before"]["ate_rmse_m"]


def test_reference_in_another_frame_and_rate(files, orbit):
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=0)
    here = Trajectory(orbit.times, orbit.poses)
    move = np.array([[3.0, -2.0, 1.0, 0.5, 0.5, 0.5, 0.5]])
    moved = _core.compose(_core.PoseModel.SE3, move.repeat(len(orbit.poses), axis=0), orbit.poses)
    there = Trajectory(orbit.times + 0.004, moved)
    errors = [run(noisy, reference=path).report["trajectory_error"] for path in (here, there)]
    for when in ("before", "after"):
        for name in ("ate_rmse_m", "mean_m"):
            assert errors[0][when][name] == pytest.approx(errors[1][when][name], rel=1e-6)


def test_objects_have_a_place_a_size_and_a_sigma(files, orbit):
    recording, _ = load_recording(*files)
    result = run(perturb_odometry(recording, NOISE, seed=0))
    estimate = result.estimate
    for row, entry in enumerate(result.report["objects"]):
        np.testing.assert_array_equal(entry["center_m"], estimate.centers[row])
        np.testing.assert_array_equal(entry["semi_axes_m"], estimate.semi_axes[row])
        variance = np.trace(result.marginals.centers[row])
        assert entry["center_sigma_m"] == pytest.approx(np.sqrt(variance))
        assert 0.0 < entry["center_sigma_m"] < 0.1


def test_evidence_for_an_estimate_and_against_it(files, monkeypatch):
    monkeypatch.setattr("dqslam.pipeline.batch.FEWEST_IMAGES_A_KEYFRAME", 0)
    recording, _ = load_recording(*files)
    noisy = run(perturb_odometry(recording, NOISE, seed=0)).report
    evidence = noisy["evidence"]
    assert evidence["log_likelihood_gain"] > 10.0
    assert evidence["objects_for"] + evidence["objects_against"] == len(noisy["objects"])
    assert not evidence["odometry_kept"]
    assert 0.005 < evidence["rms_correction_m"] < 0.2
    parts = noisy["box_noise"]
    for name in ("pixels", "relative"):
        total = np.hypot(parts["new"][name], parts["repeated"][name])
        assert parts[name] == pytest.approx(total)


def test_where_the_odometry_is_kept_the_report_says_so():
    final = SimpleNamespace(
        gain=np.array([1.0, -3.0, np.nan]), poses=np.zeros((4, 7)), keeps_odometry=True
    )
    path = np.zeros((4, 7))
    path[:, 0] = 2.0
    evidence = describe_evidence(final, path)
    assert evidence == {
        "log_likelihood_gain": -2.0,
        "objects_for": 1,
        "objects_against": 1,
        "odometry_kept": True,
        "rms_correction_m": 2.0,
    }
    assert "the odometry is kept" in warn_of_evidence(evidence)[0]
    assert "-2" in warn_of_evidence(evidence)[0]
    assert warn_of_evidence(evidence | {"odometry_kept": False}) == []
    assert warn_of_evidence(None) == []


def test_each_object_may_have_a_noise_of_its_own(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, RunOptions(mode=_core.Mode.MAPPING)).estimate
    count = len(estimate.object_ids)
    same = box_chi2(estimate, recording.detections, BoxNoise(2.0, 0.0))
    noises = [BoxNoise(2.0 * (1 + row), 0.0) for row in range(count)]
    own = box_chi2(estimate, recording.detections, noises)
    row = np.searchsorted(estimate.object_ids, recording.detections.object_id).clip(max=count - 1)
    fits = np.isfinite(same)
    np.testing.assert_allclose(own[fits], same[fits] / (1.0 + row[fits]) ** 2)
