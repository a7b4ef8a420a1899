"""Score tests of the calibration, and its estimation, against planted deviations."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.calibration import CalibrationFinding

ELLIPSOIDS = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
NOISE = dq.BoxNoise(pixels=1.0, relative=0.0)


def recording_of(seed, **camera):
    """A drive, and what its estimator takes for the camera; angles turn it, in degrees."""
    recording, truth = dq.simulate(ELLIPSOIDS, seed=seed)
    recording = replace(recording, positions=None)
    true = recording.camera
    turn = np.deg2rad([camera.get("pitch", 0.0), camera.get("yaw", 0.0), 0.0])
    mount = _core.plus(
        dq.PoseModel.SE3, true.robot_from_camera[None], np.concatenate([np.zeros(3), -turn])[None]
    )[0]
    focal = true.fx / (1.0 + camera.get("focal", 0.0))
    given = dq.Camera(
        focal, focal, true.cx, true.cy, true.width, true.height, robot_from_camera=mount
    )
    return replace(recording, camera=given), truth


def solved(recording, box_noise=NOISE):
    graph = dq.build_graph(recording, box_noise=box_noise)
    return graph, dq.solve(graph)[0]


def mean_error(estimate, truth):
    return np.linalg.norm(estimate.poses[:, :2] - truth.poses[:, :2], axis=1).mean()


@pytest.mark.parametrize("box_noise", [NOISE, None])
def test_a_right_calibration_is_not_doubted(box_noise):
    for seed in range(40, 52):
        recording, _ = recording_of(seed)
        graph, estimate = solved(recording, box_noise)
        assert dq.check_calibration(graph, estimate) == (), seed


@pytest.mark.parametrize(
    ("name", "planted", "value"),
    [
        ("mount_yaw", {"yaw": 2.0}, np.deg2rad(2.0)),
        ("mount_pitch", {"pitch": 2.0}, np.deg2rad(2.0)),
        ("focal_length", {"focal": 0.02}, 0.02),
    ],
)
def test_a_deviation_is_found_and_estimated(name, planted, value):
    found = []
    for seed in range(40, 46):
        recording, truth = recording_of(seed, **planted)
        graph, estimate = solved(recording)
        findings = dq.check_calibration(graph, estimate)
        found.append(bool(findings) and name in (findings[0].name, *findings[0].rivals))
        calibrated, better, _, (finding,) = dq.solve_with_calibration(graph, [name])
        assert finding.name == name
        assert abs(finding.value - value) < 4.5 * finding.sigma
        assert finding.sigma < 0.4 * value
        exact, _ = recording_of(seed)
        assert mean_error(better, truth) < 1.3 * mean_error(solved(exact)[1], truth) + 0.03
        assert dq.check_calibration(calibrated, better) == ()
    assert sum(found) >= 5


def test_the_size_of_the_world_tells_the_scale_only_where_sizes_are_known():
    recording, _ = recording_of(40)
    odometry = recording.odometry
    longer = odometry.relative * [1.1, 1.1, 1.0]
    recording = replace(recording, odometry=replace(odometry, relative=longer))
    graph, estimate = solved(recording)
    names = [finding.name for finding in dq.check_calibration(graph, estimate)]
    assert "odometry_scale" not in names
    with pytest.raises(ValueError, match="the data do not determine odometry_scale"):
        dq.solve_with_calibration(graph, ["odometry_scale", "object_size"])


def test_recalibration_by_hand():
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph, estimate = solved(recording)
    state = _core.State(estimate.poses, estimate.ellipsoids)
    names = dq.calibration_parameters()
    deviations = np.zeros(len(names))
    for name, value in (
        ("mount_forward", 0.1),
        ("focal_length", 0.01),
        ("principal_v", -3.0),
        ("odometry_scale", 0.05),
        ("gyro_bias", 0.002),
        ("object_size", 0.3),
    ):
        deviations[names.index(name)] = value
    found = _core.recalibrate(graph.core, state, graph.timestamps, deviations)
    camera, before = found.camera, graph.core.camera
    assert camera.fx == pytest.approx(1.01 * before.fx)
    assert camera.cy == pytest.approx(before.cy - 3.0)
    assert camera.robot_from_camera[0] == pytest.approx(before.robot_from_camera[0] + 0.1)
    seconds = np.diff(graph.timestamps)
    relative = graph.core.odometry.relative
    np.testing.assert_allclose(found.odometry.relative[:, :2], 1.05 * relative[:, :2])
    np.testing.assert_allclose(found.odometry.relative[:, 2], relative[:, 2] + 0.002 * seconds)
    np.testing.assert_allclose(
        found.odometry.covariance[:, [0, 2, 8]],
        graph.core.odometry.covariance[:, [0, 2, 8]] * [1.05**2, 1.05, 1.0],
    )
    np.testing.assert_allclose(found.size_prior.log_mean, graph.core.size_prior.log_mean + 0.3)
    np.testing.assert_array_equal(found.boxes.box, graph.core.boxes.box)


def test_a_delay_moves_boxes_by_the_motion_of_the_camera():
    """The drive's first poses go straight along x; the camera looks to the left, along y."""
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph, estimate = solved(recording)
    state = _core.State(estimate.poses, estimate.ellipsoids)
    deviations = np.zeros(len(dq.calibration_parameters()))
    deviations[dq.calibration_parameters().index("time_offset")] = 0.1
    moved = _core.recalibrate(graph.core, state, graph.timestamps, deviations).boxes.box
    row = int(np.flatnonzero((graph.core.boxes.pose > 2) & (graph.core.boxes.pose < 12))[0])
    center = estimate.ellipsoids[graph.core.boxes.object[row], :3]
    pose = estimate.poses[graph.core.boxes.pose[row]]
    depth = (center[:2] - pose[:2]) @ [-np.sin(pose[2]), np.cos(pose[2])]
    flow = graph.core.camera.fx * 0.1 * 0.5 / depth  # 0.5 m in a second, 0.1 s later
    shift = (moved - graph.core.boxes.box)[row]
    np.testing.assert_allclose(shift[[0, 2]], flow, rtol=0.2)
    np.testing.assert_allclose(shift[[1, 3]], 0.0, atol=0.1 * abs(flow))


def test_sentences_have_degrees_and_percent():
    yaw = CalibrationFinding("mount_yaw", np.deg2rad(1.9), np.deg2rad(0.1), "rad", ("principal_u",))
    assert str(yaw) == (
        "the boxes say that the camera is turned sideways by 1.9 ± 0.1 deg (or principal_u)"
    )
    assert yaw.sigmas == pytest.approx(19.0)
    focal = CalibrationFinding("focal_length", -0.02, 0.001, "")
    assert str(focal).endswith("the focal length is larger by -2 ± 0.1 %")


def test_what_does_not_fit_is_refused():
    recording, _ = recording_of(40)
    graph, estimate = solved(recording)
    with pytest.raises(ValueError, match="no parameter 'yaw', only: mount_pitch, mount_yaw"):
        dq.solve_with_calibration(graph, ["yaw"])
    with pytest.raises(TypeError, match="estimate, summary = solve"):
        dq.check_calibration(graph, graph)


def test_objects_that_are_not_in_the_estimate_take_no_part():
    recording, _ = recording_of(40, yaw=2.0)
    detections = recording.detections
    box = detections.box.copy()
    one = np.flatnonzero(detections.object_id == detections.object_id.max())
    corner = np.random.default_rng(0).uniform(0.0, 500.0, size=(len(one), 2))
    box[one] = np.hstack([corner, corner + 100.0])  # it jumps about in the image
    recording = replace(recording, detections=replace(detections, box=box))
    graph, estimate = solved(recording)
    assert len(estimate.dropped) == 1
    found = dq.check_calibration(graph, estimate)
    assert found[0].name == "mount_yaw"
    assert found[0].value == pytest.approx(np.deg2rad(2.0), abs=4.0 * found[0].sigma)


def test_a_run_warns_of_a_turned_mount_and_reports_it():
    recording, _ = recording_of(41, yaw=3.0)
    report = dq.run(recording).report
    assert "mount_yaw" in {report["calibration"][0]["name"], *report["calibration"][0]["rivals"]}
    assert any(warning.startswith("the boxes say that") for warning in report["warnings"])
    exact, _ = recording_of(41)
    report = dq.run(exact).report
    assert report["calibration"] == []
    assert report["warnings"] == []


@pytest.mark.parametrize("error", [RuntimeError, ValueError])
def test_a_run_goes_on_where_the_calibration_cannot_be_tested(monkeypatch, error):
    def fails(*_):
        raise error("a residual is undefined at this state")

    recording, _ = recording_of(41)
    monkeypatch.setattr("dqslam.pipeline.batch.check_calibration", fails)
    result = dq.run(recording)
    assert result.report["calibration"] == []
    assert len(result.estimate.object_ids) >= 5
