"""Fits of boxes and errors of poses, on results with planted errors."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planted
from dqslam import io
from dqslam.evaluation import evaluate_results, fit_boxes, pose_errors
from oracle import bounding_box, ellipsoid_surface, se3_matrix


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("planted"), drift=0.3)


@pytest.fixture(scope="module")
def results(files):
    return io.load_results(files.results)


def of(fits, number):
    return fits.boxes.object_id == number


def test_a_perfect_object_fits_and_one_that_is_not_mapped_has_nothing(results):
    fits = fit_boxes(results)
    np.testing.assert_allclose(fits.residual[of(fits, 14)], 0.0, atol=1e-4)
    np.testing.assert_allclose(fits.chi2[of(fits, 14)], 0.0, atol=1e-7)
    np.testing.assert_allclose(fits.overlap[of(fits, 14)], 1.0, atol=1e-4)
    assert (fits.object_row[of(fits, 13)] == -1).all()
    for table in (fits.predicted, fits.residual, fits.overlap, fits.chi2):
        assert np.isnan(table[of(fits, 13)]).all()
    assert not fits.is_uncut[of(fits, 13)].any()


def test_a_shifted_object_by_brute_force(results):
    fits = fit_boxes(results)
    row = int(np.flatnonzero(of(fits, 10))[3])
    surface = ellipsoid_surface(
        planted.CENTERS[0] + [0, 0, planted.CENTER_ERROR],
        planted.SEMI_AXES,
        planted.TURNS[0].as_quat(),
    )
    pose = se3_matrix(results.poses[fits.boxes.pose[row]])
    expected = bounding_box(planted.CAMERA, pose, surface)
    np.testing.assert_allclose(fits.predicted[row], expected, atol=0.02)
    u_min, v_min, u_max, v_max = fits.boxes.box[row]
    sigma_u, sigma_v = np.hypot(2.0, 0.05 * (u_max - u_min)), np.hypot(2.0, 0.05 * (v_max - v_min))
    off = fits.predicted[row] - fits.boxes.box[row]
    by_hand = off / [sigma_u, sigma_v, sigma_u, sigma_v]
    np.testing.assert_allclose(fits.residual[row], by_hand, rtol=1e-9)
    assert fits.chi2[row] == pytest.approx(np.sum(by_hand**2))


def test_sigmas_are_those_of_the_report(results):
    given = replace(results, report={"box_noise": {"pixels": 4.0, "relative": 0.0}})
    fits = fit_boxes(given)
    known = np.isfinite(fits.overlap)
    off = fits.predicted[known] - fits.boxes.box[known]
    np.testing.assert_allclose(fits.residual[known], off / 4.0, rtol=1e-9)
    wrong = replace(results, report={"box_noise": {"pixels": -1.0, "relative": 0.0}})
    with pytest.raises(io.FileError, match=r"report.json: box_noise: .*positive"):
        fit_boxes(wrong)


def test_an_edge_that_the_image_cuts_has_no_residual(results):
    truncated = np.zeros((len(results.boxes), 4), dtype=bool)
    row = int(np.flatnonzero(results.boxes.object_id == 14)[0])
    truncated[row, 2] = True
    fits = fit_boxes(replace(results, boxes=replace(results.boxes, truncated=truncated)))
    np.testing.assert_array_equal(np.isnan(fits.residual[row]), [False, False, True, False])
    assert np.isnan(fits.chi2[row])
    assert not fits.is_uncut[row]


def test_frames_from_the_worst(results):
    fits = fit_boxes(results)
    pose, mean = fits.frames()
    assert sorted(pose) == list(range(planted.POSES))
    assert (np.diff(mean) >= 0.0).all()
    by_hand = np.nanmean(fits.overlap[fits.boxes.pose == pose[0]])
    assert mean[0] == pytest.approx(by_hand)
    assert len(fits.frames(least_boxes=5)[0]) == 0  # one of five is not mapped


def test_nothing_to_compare(results):
    with pytest.raises(ValueError, match=r"there is no boxes.csv"):
        fit_boxes(replace(results, boxes=None))


def test_distances_are_those_that_the_evaluation_summarizes(files, results):
    truth = io.read_trajectory(files.groundtruth)
    for align in ("se3", "sim3", "none"):
        errors = pose_errors(results, truth, align=align)
        summary = evaluate_results(results, truth, align=align)
        for name, values in (("ate", errors.distance), ("odometry_ate", errors.odometry_distance)):
            assert np.sqrt(np.mean(values**2)) == pytest.approx(summary[name]["rmse"], abs=1e-9)
            assert np.max(values) == pytest.approx(summary[name]["max"], abs=1e-9)


def test_a_planted_error_of_one_pose(files, results):
    """In the world of the truth, which is another one."""
    shift, turn = np.array([0.03, -0.02, 0.01]), Rotation.from_rotvec([0.1, 0.2, -0.3])
    poses = results.poses.copy()
    in_estimate = planted.TURN.inv()
    poses[7, :3] += in_estimate.apply(shift)
    turned = in_estimate * turn * planted.TURN * Rotation.from_quat(poses[7, 3:])
    poses[7, 3:] = turned.as_quat()
    truth = io.read_trajectory(files.groundtruth)
    errors = pose_errors(replace(results, poses=poses), truth)
    np.testing.assert_allclose(errors.position[7], shift, atol=1e-6)
    np.testing.assert_allclose(errors.rotation[7], turn.as_rotvec(), atol=1e-6)
    others = np.arange(planted.POSES) != 7
    np.testing.assert_allclose(errors.position[others], 0.0, atol=1e-6)
    np.testing.assert_allclose(errors.rotation[others], 0.0, atol=1e-6)


def test_sigmas_turn_with_the_camera(files, results):
    covariance = np.full((planted.POSES, 6, 6), np.nan)
    along_axis = np.diag([1e-4, 4e-4, 9e-4, 1e-6, 4e-6, 9e-6])
    covariance[4] = along_axis
    truth = io.read_trajectory(files.groundtruth)
    errors = pose_errors(replace(results, covariances=covariance), truth)
    camera = Rotation.from_quat(truth.world_from_camera[4, 3:]).as_matrix()
    expected = np.sqrt(np.diag(camera @ along_axis[:3, :3] @ camera.T))
    np.testing.assert_allclose(errors.position_sigma[4], expected, rtol=1e-6)
    np.testing.assert_allclose(errors.rotation_sigma[4], expected / 10.0, rtol=1e-6)
    assert np.isnan(errors.position_sigma[5]).all()


def test_a_scale_is_that_of_the_truth(tmp_path):
    files = planted.write_planted(tmp_path, scale=2.0)
    results = io.load_results(files.results)
    covariance = np.tile(0.01**2 * np.eye(6), (planted.POSES, 1, 1))
    truth = io.read_trajectory(files.groundtruth)
    errors = pose_errors(replace(results, covariances=covariance), truth, align="sim3")
    np.testing.assert_allclose(errors.position, 0.0, atol=1e-6)
    np.testing.assert_allclose(errors.position_sigma, 0.02, rtol=1e-6)
    np.testing.assert_allclose(errors.rotation_sigma, 0.01, rtol=1e-6)
