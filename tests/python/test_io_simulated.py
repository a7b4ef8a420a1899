"""A simulated recording as files: what is read back is what was written."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from dqslam import _core, build_graph, io, load_scenario, simulate, solve
from dqslam.recording import Detections, Odometry, Recording


def written(tmp_path, scenario, seed):
    recording, truth = simulate(load_scenario(scenario), seed=seed)
    io.save_recording(recording, tmp_path)
    io.save_truth(truth, recording, tmp_path)
    loaded, dropped = io.load_recording(
        tmp_path / "camera.json",
        tmp_path / "odometry.txt",
        tmp_path / "boxes.csv",
        odometry_covariance=tmp_path / "odometry_covariance.csv",
    )
    return recording, truth, loaded, dropped


@pytest.mark.parametrize("scenario", ["paper", "orbit"])
def test_what_is_read_is_what_was_recorded(tmp_path, scenario):
    recording, _, loaded, dropped = written(tmp_path, scenario, 1)
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        assert getattr(loaded.camera, name) == getattr(recording.camera, name)
    np.testing.assert_array_equal(loaded.timestamps, recording.timestamps)
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    cameras = _core.world_from_camera(odometry.pose_model, recording.camera, path)
    read = loaded.odometry
    again = _core.dead_reckon(read.pose_model, read.first_pose, read.relative)
    np.testing.assert_allclose(again[:, :3], cameras[:, :3], atol=1e-6)
    few = np.isin(recording.detections.object_id, list(dropped.few_boxes))
    kept = recording.detections.select(~few)
    assert dropped.total == few.sum()
    order = np.lexsort((kept.object_id, kept.pose))
    np.testing.assert_array_equal(loaded.detections.object_id, kept.object_id[order])
    np.testing.assert_array_equal(loaded.detections.pose, kept.pose[order])
    # Reading cuts what the noise pushed out of the image.
    last = np.array([recording.camera.width, recording.camera.height] * 2) - 0.5
    box = np.clip(kept.box[order], -0.5, last)
    np.testing.assert_allclose(loaded.detections.box, box, atol=1e-6)


def test_the_noise_of_a_step_in_space_by_hand(tmp_path):
    """The paper's camera looks left from 0 m: forward of the robot is right in the image."""
    recording, _, loaded, _ = written(tmp_path, "paper", 0)
    planar, lifted = recording.odometry.covariance, loaded.odometry.covariance
    np.testing.assert_allclose(recording.camera.robot_from_camera[:3], 0.0)
    # Robot x, y are the camera's x, z; a turn to the left is about the camera's -y.
    expected = np.zeros_like(lifted)
    for row, planar_row in ((0, 0), (2, 1), (4, 2)):
        for column, planar_column in ((0, 0), (2, 1), (4, 2)):
            sign = -1.0 if (row == 4) != (column == 4) else 1.0
            expected[:, row, column] = sign * planar[:, planar_row, planar_column]
    for left_out in (1, 3, 5):  # height, and the tilts
        expected[:, left_out, left_out] = 1e-3**2
    np.testing.assert_allclose(lifted, expected, atol=1e-12)


@pytest.mark.parametrize(("scenario", "seed"), [("orbit", 1), ("honest_orbit", 4)])
def test_in_space_the_files_give_the_estimate_of_the_recording(tmp_path, scenario, seed):
    """To a millimeter, where odometry is decimeters off; the files have no relative positions."""
    recording, truth, loaded, _ = written(tmp_path, scenario, seed)
    estimate, _ = solve(build_graph(replace(recording, positions=None)))
    again, _ = solve(build_graph(loaded))
    cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, estimate.poses)
    off = np.linalg.norm(again.poses[:, :3] - cameras[:, :3], axis=1)
    assert off.max() < 1e-3
    np.testing.assert_array_equal(again.object_ids, estimate.object_ids)
    np.testing.assert_allclose(again.centers, estimate.centers, atol=1e-3)
    start = np.linalg.norm(estimate.initial_poses[:, :3] - truth.poses[:, :3], axis=1)
    assert start.max() > 0.2


def test_the_truth_is_read_again(tmp_path):
    recording, truth, loaded, _ = written(tmp_path, "orbit", 2)
    objects = io.read_true_objects(tmp_path / "objects.csv")
    np.testing.assert_array_equal(objects.id, truth.object_ids)
    assert objects.class_name == truth.class_names
    np.testing.assert_allclose(objects.center, truth.centers, atol=1e-12)
    np.testing.assert_allclose(np.pi / 6 * objects.size.prod(axis=1), truth.volumes, rtol=1e-12)
    for row, ellipsoid in enumerate(truth.ellipsoids):
        turned = objects.rotation[row] * (objects.size[row] / 2.0)
        lower = np.diag(np.exp(ellipsoid[3:6]))
        lower[[1, 2, 2], [0, 0, 1]] = ellipsoid[6:]
        np.testing.assert_allclose(turned @ turned.T, lower @ lower.T, atol=1e-9)
    path = io.read_trajectory(tmp_path / "groundtruth.txt").world_from_camera
    cameras = _core.world_from_camera(truth.pose_model, recording.camera, truth.poses)
    np.testing.assert_allclose(path[:, :3], cameras[:, :3], atol=1e-8)
    boxes = io.read_true_boxes(tmp_path / "true_boxes.csv", loaded.camera)
    np.testing.assert_array_equal(boxes.object_id, truth.box_object_id)


def test_a_cube_has_the_size_of_its_side(tmp_path):
    _, truth, _, _ = written(tmp_path, "paper", 0)
    objects = io.read_true_objects(tmp_path / "objects.csv")
    np.testing.assert_allclose(objects.size, np.tile(np.cbrt(truth.volumes)[:, None], 3))
    assert objects.rotation is None
    assert set(objects.class_name) == {"cube"}


def test_boxes_are_written_as_the_lens_records_them(tmp_path):
    lens = _core.Camera(100.0, 100.0, 50.0, 50.0, 100, 100, distortion=[0.1, 0, 0, 0, 0])
    boxes = [[20.0, 20, 29, 32], [21.0, 20, 29, 33], [22.0, 21, 29, 34]]
    recording = Recording(
        camera=lens,
        timestamps=[0.0, 1.0, 2.0],
        odometry=Odometry.from_poses(np.eye(3), covariance=np.eye(3)),
        detections=Detections([0, 1, 2], boxes, [1.0] * 3, [0] * 3, [0] * 3, {0: "cup"}),
    )
    io.save_recording(recording, tmp_path)
    files = [tmp_path / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    again, _ = io.load_recording(*files)
    np.testing.assert_allclose(again.detections.box, boxes, atol=1e-5)
    # Points 30 px from the middle are recorded 1 + 0.1 * 0.3^2 times as far from it, or more.
    first = np.loadtxt(files[2], delimiter=",", skiprows=1, usecols=(2, 3))[0]
    assert np.all((first < 19.8) & (first > 19.0))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("\n0.2,", "\n0.21,", r"covariance\.csv:2: timestamp 0\.21 is of no pose"),
        ("\n0.2,", "\n#0.2,", r"covariance\.csv: no covariance of the step that ends at 0\.2"),
        ("\n0.2,0.0001,", "\n0.2,0,", r"covariance\.csv: .* at 0\.200000 s is not positive def"),
        ("\n0.2,0.0001,", "\n0.2,-1,", r"covariance\.csv:2: a variance is negative"),
        (",c66", ",d66", r"covariance\.csv:1: no column c66"),
    ],
)
def test_bad_covariances_are_named(tmp_path, old, new, message):
    recording, *_ = written(tmp_path, "orbit", 0)
    path = tmp_path / "odometry_covariance.csv"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(io.FileError, match=message):
        io.read_step_covariances(path, recording.timestamps)


def test_cuboids_have_their_sides_and_orientation(tmp_path):
    _, truth, _, _ = written(tmp_path, "loop_cuboids", 1)
    read = io.read_true_objects(tmp_path / "objects.csv")
    np.testing.assert_array_equal(read.size, 2.0 * truth.cuboids[:, 3:6])
    for row, turn in enumerate(truth.cuboids[:, 6:]):
        np.testing.assert_allclose(read.rotation[row], oracle.quaternion_matrix(turn), atol=1e-12)
    np.testing.assert_allclose(read.size.prod(axis=1), truth.volumes)


def test_boxes_that_show_nothing_are_of_no_object(tmp_path):
    recording, truth, _, _ = written(tmp_path, "false_own_20", 1)
    read = io.read_true_boxes(tmp_path / "true_boxes.csv", recording.camera)
    np.testing.assert_array_equal(read.object_id, truth.box_object_id)
    assert (read.object_id == -1).mean() == pytest.approx(0.2, abs=0.01)
