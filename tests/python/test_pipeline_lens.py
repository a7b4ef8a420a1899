"""Recordings through lenses: exact boxes, and objects outside the rectangle of the pinhole."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core, io
from dqslam.lens import Lens, camera_with, distort_boxes, distorted_or_nan, outline_tilts
from dqslam.online.inputs import box_noise_rows
from dqslam.pipeline.lens import exact_boxes, widened

SE3 = _core.PoseModel.SE3
BARREL = Lens("plumb_bob", (-0.28, 0.07, 2e-4, 2e-5, 0.0))
FISHEYE = Lens("equidistant", (-0.013, 0.02, -0.01, 0.002))
CASES = {"barrel": (BARREL, 525.0, 0.5), "fisheye": (FISHEYE, 220.0, 0.9)}


def turned(poses, angle):
    """Poses turned aside by an angle, to the left and to the right by turns."""
    half = 0.5 * angle * np.where(np.arange(len(poses)) // 4 % 2, 1.0, -1.0)
    zero = np.zeros(len(poses))
    aside = np.column_stack([zero, zero, zero, zero, np.sin(half), zero, np.cos(half)])
    return _core.compose(SE3, poses, aside)


def through(lens, focal, angle):
    """A noise-free recording through a lens, and its truth: objects are seen at the border."""
    simulated, truth = dq.simulate(dq.load_scenario("orbit"), seed=3)
    cameras = _core.world_from_camera(SE3, simulated.camera, truth.poses)
    poses = turned(cameras[::3], angle)
    camera = camera_with(dq.Camera(focal, focal, 319.5, 239.5, 640, 480), lens)
    pose, object_id, boxes = [], [], []
    for row, here in enumerate(poses):
        all_here = np.tile(here, (len(truth.ellipsoids), 1))
        ideal, in_front = _core.project_to_boxes(SE3, camera, all_here, truth.ellipsoids)
        tilts = outline_tilts(SE3, camera, all_here, truth.ellipsoids)[in_front]
        box = distorted_or_nan(camera, ideal[in_front], tilts)
        inside = np.all((box[:, :2] > 3) & (box[:, 2:] < [636, 476]), axis=1)  # false for NaN
        boxes.append(box[inside])
        pose += [row] * int(inside.sum())
        object_id += truth.object_ids[in_front][inside].tolist()
    recorded = np.concatenate(boxes)
    detections = dq.Detections.from_xyxy(pose, recorded + 0.5, object_id=object_id, camera=camera)
    odometry = dq.Odometry.from_poses(poses, covariance=np.eye(6) * 1e-6)
    times = np.arange(len(poses)) * 0.2
    return dq.Recording(camera, times, odometry, detections), truth, recorded


@pytest.mark.parametrize("case", CASES)
def test_boxes_of_a_run_are_exact(case):
    recording, truth, recorded = through(*CASES[case])
    noise = dq.BoxNoise(pixels=1.0, relative=0.0)
    vague = dq.SizePrior(log_mean=np.log(0.1), log_sigma=10.0)
    options = dq.RunOptions(mode=dq.Mode.MAPPING, box_noise=noise, size_prior=vague)
    result = dq.run(recording, options)
    estimate = result.estimate
    assert estimate.camera is recording.camera
    seen = np.isin(truth.object_ids, estimate.object_ids)
    assert len(estimate.object_ids) == len(np.unique(recording.detections.object_id))
    errors = np.linalg.norm(estimate.centers - truth.centers[seen], axis=1)
    assert errors.max() < 1e-3  # meters
    row = np.searchsorted(estimate.object_ids, result.detections.object_id)
    poses, ellipsoids = estimate.poses[result.detections.pose], estimate.ellipsoids[row]
    projected, _ = _core.project_to_boxes(SE3, estimate.camera, poses, ellipsoids)
    tilts = outline_tilts(SE3, estimate.camera, poses, ellipsoids)
    again = distort_boxes(estimate.camera, projected, tilts)
    assert np.abs(again - recorded).max() < 0.1
    # What was assumed at first, the tilts of spheres, is off by more.
    first = distort_boxes(estimate.camera, projected)
    assert np.abs(first - recorded).max() > 1.0
    np.testing.assert_allclose(
        distort_boxes(estimate.camera, result.detections.box, tilts), recorded, atol=1e-6
    )
    assert result.report["boxes"]["chi2_median"] < 1e-3


def test_objects_beyond_the_rectangle_of_the_pinhole_are_found():
    recording, truth, _ = through(*CASES["fisheye"])
    box = recording.detections.box
    outside = (box[:, 2:] < 0).any(axis=1) | (box[:, :2] > [639, 479]).any(axis=1)
    assert outside.mean() > 0.2
    ids = np.full(len(box), -1)
    unknown = replace(recording, detections=replace(recording.detections, object_id=ids))
    result = dq.run(unknown)
    assert np.mean(result.detections.object_id[outside] >= 0) > 0.95
    nearest = np.linalg.norm(result.estimate.centers[:, None] - truth.centers, axis=2).min(axis=1)
    assert nearest.max() < 0.01


def test_the_wider_image_is_the_same_camera_moved():
    recording, _, _ = through(*CASES["barrel"])
    wide, offset = widened(recording)
    camera = wide.camera
    assert (camera.width, camera.height) > (640 + 2 * 60, 480)
    np.testing.assert_array_equal([camera.cx, camera.cy], [319.5, 239.5] + offset)
    moved = recording.detections.box + np.tile(offset, 2)
    np.testing.assert_array_equal(wide.detections.box, moved)
    corners = np.array([[-0.5, -0.5], [639.5, -0.5], [-0.5, 479.5], [639.5, 479.5]])
    ideal = camera.undistort_points(corners + offset)
    assert np.all(ideal >= -0.5) and np.all(ideal <= [camera.width - 0.5, camera.height - 0.5])
    np.testing.assert_allclose(
        ideal - offset, recording.camera.undistort_points(corners), atol=1e-9
    )
    inside = recording.detections.select(np.all(recording.detections.box > 0, axis=1))
    straight = dq.Camera(525, 525, 319.5, 239.5, 6400, 4800)
    plain = replace(recording, camera=straight, detections=inside)
    assert widened(plain)[0] is plain


def test_boxes_of_objects_behind_the_camera_stay():
    camera = camera_with(dq.Camera(525, 525, 319.5, 239.5, 640, 480), BARREL)
    behind = _core.ellipsoid_from_axes([0, 0, -2], [0.1] * 3, [0, 0, 0, 1])
    boxes = np.array([[10.0, 20.0, 60.0, 90.0]] * 2)
    here = np.array([[0, 0, 0, 0, 0, 0, 1.0]] * 2)
    found = exact_boxes(camera, SE3, here, np.array([behind, np.full(9, np.nan)]), boxes)
    np.testing.assert_allclose(found, boxes, atol=1e-6)


def test_a_lens_survives_solve_and_files(tmp_path):
    recording, _, _ = through(*CASES["fisheye"])
    estimate, _ = dq.solve(dq.build_graph(recording), dq.SolveOptions(mode=dq.Mode.MAPPING))
    assert estimate.camera.lens == FISHEYE
    io.save_estimate(estimate, tmp_path / "results")
    again = io.load_results(tmp_path / "results").camera
    assert again.lens == FISHEYE
    assert (again.fx, again.width) == (220.0, 640)


def test_the_noise_of_a_detector_grows_where_the_lens_shrinks():
    camera = camera_with(dq.Camera(220, 220, 319.5, 239.5, 640, 480), FISHEYE)
    box = np.array([[315.0, 235.0, 325.0, 245.0], [900.0, 235.0, 930.0, 245.0]])
    noise = dq.BoxNoise(pixels=1.0, relative=0.0)
    sigma = np.sqrt(np.diagonal(noise.covariance(box, camera), axis1=1, axis2=2))
    np.testing.assert_allclose(sigma[0], 1.0, atol=0.01)
    # d/dtheta tan(theta) = 1 + tan(theta)^2 across the image, at theta = atan(580.5 / 220).
    across = 1 + (580.5 / 220) ** 2
    assert 0.8 * across < sigma[1, 0] < 1.25 * across
    np.testing.assert_array_equal(noise.covariance(box), np.tile(np.eye(4), (2, 1, 1)))


def test_a_session_has_the_noise_of_the_batch():
    camera = camera_with(dq.Camera(220, 220, 319.5, 239.5, 640, 480), FISHEYE)
    box = np.array([[315.0, 235.0, 325.0, 245.0], [900.0, 235.0, 930.0, 245.0]])
    noise = dq.BoxNoise(pixels=1.5, relative=0.1)
    rows = box_noise_rows(noise, box, camera)
    np.testing.assert_allclose(rows.reshape(2, 4, 4), noise.covariance(box, camera))


def test_a_recording_through_a_lens_is_replayed_step_by_step():
    recording, truth, _ = through(*CASES["fisheye"])
    result = dq.run(recording, online=True)
    nearest = np.linalg.norm(result.estimate.centers[:, None] - truth.centers, axis=2).min(axis=1)
    assert len(nearest) == 8
    assert nearest.max() < 0.02
    assert result.estimate.camera is recording.camera
