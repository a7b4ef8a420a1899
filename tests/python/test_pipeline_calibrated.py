"""Runs that estimate parameters of the calibration with all else."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main

PAPER = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})


def wrong(**calibration):
    """A world in which the estimator is given a wrong calibration."""
    settings = PAPER.calibration.model_copy(update=calibration)
    return PAPER.model_copy(update={"calibration": settings})


@cache
def recording_of(seed, **calibration):
    recording, truth = dq.simulate(wrong(**calibration), seed=seed)
    return replace(recording, positions=None), truth


def mean_error(result, truth):
    return np.linalg.norm(result.estimate.poses[:, :2] - truth.poses[:, :2], axis=1).mean()


def test_a_turned_mount_is_estimated_and_used():
    recording, truth = recording_of(41, mount_yaw_deg=2.0)
    plain = dq.run(recording)
    result = dq.run(recording, dq.RunOptions(estimate=("mount_yaw",)))
    found = result.report["estimated_calibration"]["mount_yaw"]
    assert found["unit"] == "rad"
    assert abs(found["value"] - np.deg2rad(2.0)) < 4.0 * found["sigma"]
    assert found["sigma"] < np.deg2rad(0.3)
    assert mean_error(result, truth) < 0.5 * mean_error(plain, truth)
    # The mount of the result is the true one, to within what the report says.
    true = recording_of(41)[0].camera.robot_from_camera[3:]
    given, used = (one.camera.robot_from_camera[3:] for one in (recording, result.estimate))
    assert 2.0 * np.arccos(abs(given @ true)) == pytest.approx(np.deg2rad(2.0), rel=1e-6)
    assert 2.0 * np.arccos(min(abs(used @ true), 1.0)) < 4.0 * found["sigma"]
    assert plain.report["estimated_calibration"] == {}
    assert {one["name"] for one in plain.report["calibration"]} & {"mount_yaw", "principal_u"}
    assert result.report["calibration"] == []


def test_boxes_are_returned_as_they_were_given_though_images_are_late():
    recording, _ = recording_of(41, time_offset_s=0.1)
    result = dq.run(recording, dq.RunOptions(estimate=("time_offset",), hold_out=0.1))
    found = result.report["estimated_calibration"]["time_offset"]
    assert abs(found["value"] - 0.1) < 4.0 * found["sigma"]
    np.testing.assert_allclose(result.detections.box, recording.detections.box, atol=1e-9)


def test_covariances_are_wider_than_for_a_known_calibration():
    recording, _ = recording_of(41)
    known = dq.run(recording)
    estimated = dq.run(recording, dq.RunOptions(estimate=("mount", "focal")))
    assert set(estimated.report["estimated_calibration"]) == {
        "mount_pitch",
        "mount_yaw",
        "mount_roll",
        "focal_length",
    }
    both = np.isfinite(known.marginals.poses).all(axis=(1, 2))
    both &= np.isfinite(estimated.marginals.poses).all(axis=(1, 2))
    traces = [
        np.trace(one.marginals.poses[both][1:], axis1=1, axis2=2) for one in (known, estimated)
    ]
    assert np.median(traces[1] / traces[0]) > 1.05


def test_what_the_boxes_do_not_determine_is_said_and_stays():
    recording, _ = recording_of(41)
    report = dq.run(recording, dq.RunOptions(estimate=("mount_up", "odometry_scale"))).report
    assert report["estimated_calibration"] == {}
    assert "the boxes do not determine mount_up, which is as given" in report["warnings"]
    assert (
        "the boxes do not determine odometry_scale, which is as given: the sizes of objects are "
        "not known"
    ) in report["warnings"]


def test_known_sizes_tell_the_scale_of_the_odometry():
    """Each axis of each object is drawn from the prior, as the prior has it."""
    scenario = dq.load_scenario("honest")
    recording, _ = dq.simulate(scenario, seed=41)
    odometry = recording.odometry
    longer = replace(odometry, relative=odometry.relative * [1.5, 1.5, 1.0])
    size = scenario.world.log_normal_size
    prior = dq.SizePrior(np.log(size.median_m), np.log(size.spread))
    options = dq.RunOptions(estimate=("odometry_scale",), size_prior=prior)
    longer = replace(recording, odometry=longer, positions=None)
    report = dq.run(longer, options).report
    found = report["estimated_calibration"]["odometry_scale"]
    assert found["sigma"] < 0.1
    # The steps are to be shortened by a third.
    assert abs(found["value"] + 1.0 / 3.0) < 4.0 * found["sigma"]


def test_a_session_estimates_it_too():
    recording, truth = recording_of(41, mount_yaw_deg=2.0)
    options = dq.RunOptions(estimate=("mount_yaw",))
    result = dq.run(recording, options, online=True)
    found = result.report["estimated_calibration"]["mount_yaw"]
    assert abs(found["value"] - np.deg2rad(2.0)) < 4.0 * found["sigma"]
    assert mean_error(result, truth) < 0.5 * mean_error(dq.run(recording, online=True), truth)


def test_what_cannot_be_estimated_is_refused_before_the_work():
    recording, _ = recording_of(41)
    with pytest.raises(ValueError, match="no parameter 'yaw', only: mount_pitch, mount_yaw"):
        dq.run(recording, dq.RunOptions(estimate=("yaw",)))
    options = dq.RunOptions(estimate=("mount",), mode=dq.Mode.MAPPING)
    with pytest.raises(ValueError, match="estimate: mode MAPPING takes the poses for known"):
        dq.run(recording, options)
    camera = recording.camera
    lens = dq.Camera(
        *(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height),
        distortion=[0.01, 0.0, 0.0, 0.0, 0.0],
        robot_from_camera=camera.robot_from_camera,
    )
    with pytest.raises(ValueError, match="estimate: focal_length of a camera with a distorted"):
        dq.run(replace(recording, camera=lens), dq.RunOptions(estimate=("focal",)))


def test_the_command_line_estimates_what_it_is_told(files, capsys):
    camera, odometry, detections = map(str, files)
    out = files[0].parent / "out"
    names = ("--camera", camera, "--odometry", odometry, "--detections", detections)
    given = ("--estimate", "focal, mount_yaw", "--ids", "class_id")
    assert main(["run", *names, *given, "--out", str(out)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert set(report["estimated_calibration"]) == {"focal_length", "mount_yaw"}
    assert "focal_length" in capsys.readouterr().out
