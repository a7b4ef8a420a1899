"""Paths in space; what drives on the plane is tested with the simulator."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oracle
from dqslam import _core, load_scenario, simulate
from dqslam._core import PoseModel

ORBIT = load_scenario("orbit")
SEEDS = range(10)


def changed(section, **values):
    settings = getattr(ORBIT, section).model_copy(update=values)
    return ORBIT.model_copy(update={section: settings})


@pytest.fixture(scope="module")
def runs():
    return [simulate(ORBIT, seed=seed) for seed in SEEDS]


def matrices(poses):
    result = np.tile(np.eye(4), (len(poses), 1, 1))
    result[:, :3, :3] = Rotation.from_quat(poses[:, 3:]).as_matrix()
    result[:, :3, 3] = poses[:, :3]
    return result


def test_the_camera_goes_round_the_table_one_and_a_half_times(runs):
    for _, truth in runs:
        assert (truth.pose_model, truth.poses.shape) == (PoseModel.SE3, (150, 7))
        angle = np.unwrap(np.arctan2(truth.poses[:, 1], truth.poses[:, 0]))
        np.testing.assert_allclose(angle[[0, -1]], [0.0, 3.0 * np.pi], atol=1e-9)
        distance = np.linalg.norm(truth.poses[:, :3], axis=1)
        assert 0.9 < distance.min() < distance.max() < 1.75
        assert np.linalg.norm(np.diff(truth.poses[:, :3], axis=0), axis=1).max() < 0.15


def test_the_wobble_is_smooth_and_as_large_as_it_says(runs):
    poses = np.array([truth.poses for _, truth in runs])
    around = np.hypot(poses[:, :, 0], poses[:, :, 1])
    assert around.mean() == pytest.approx(1.2, abs=0.02)
    assert around.std() == pytest.approx(0.1, rel=0.15)
    assert poses[:, :, 2].mean() == pytest.approx(0.6, abs=0.02)
    assert poses[:, :, 2].std() == pytest.approx(0.1, rel=0.15)
    left = np.array([matrices(one)[:, 2, 1] for one in poses])  # of the camera's x-y plane, upwards
    assert np.rad2deg(np.arcsin(left).std()) == pytest.approx(5.0, rel=0.15)
    assert np.abs(np.diff(poses[:, :, 2], axis=1)).max() < 0.05


def test_without_wobble_the_camera_looks_at_the_origin():
    steady = changed(
        "path",
        distance_sigma_m=0.0,
        height_sigma_m=0.0,
        roll_sigma_deg=0.0,
        pitch_sigma_deg=0.0,
        yaw_sigma_deg=0.0,
    )
    recording, truth = simulate(steady, seed=0)
    for matrix in matrices(truth.poses)[::20]:
        pixel, depth = oracle.to_pixels(recording.camera, matrix, np.zeros((1, 3)))
        np.testing.assert_allclose(pixel[0], [319.5, 239.5], atol=1e-9)
        np.testing.assert_allclose(depth, np.hypot(1.2, 0.6))
        # What is above the origin is above it in the image, too.
        above, _ = oracle.to_pixels(recording.camera, matrix, np.array([[0.0, 0.0, 0.1]]))
        assert above[0, 0] == pytest.approx(319.5)
        assert above[0, 1] < 239.5 - 30.0


def test_the_camera_is_vga(runs):
    camera = runs[0][0].camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (525.0, 525.0, 319.5, 239.5)
    assert (camera.width, camera.height) == (640, 480)


def test_objects_stand_on_the_table_or_above_it(runs):
    lift = []
    for _, truth in runs:
        assert len(truth.centers) == 8
        assert (np.abs(truth.centers[:, :2]) <= [0.75, 0.5]).all()
        for ellipsoid in truth.ellipsoids:
            surface = oracle.ellipsoid_surface(*_core.axes_from_ellipsoid(ellipsoid), count=60)
            lift.append(surface[:, 2].min())
    assert min(lift) > -1e-9
    assert max(lift) < 0.1 + 1e-3
    assert np.mean(lift) == pytest.approx(0.05, abs=0.02)


def test_cubes_stand_on_the_table_too():
    resting = changed("world", lift_max_m=0.0).model_copy(update={"objects": "cubes"})
    recording, truth = simulate(resting, seed=0)
    np.testing.assert_allclose(truth.centers[:, 2], np.cbrt(truth.volumes) / 2.0)
    assert len(recording.detections) > 800


def test_boxes_are_those_that_brute_force_finds():
    exact, truth = simulate(changed("detector", edge_sigma_px=0.0), seed=3)
    poses = matrices(truth.poses)
    for row in range(0, len(exact.detections), 97):
        ellipsoid = truth.ellipsoids[exact.detections.object_id[row]]
        surface = oracle.ellipsoid_surface(*_core.axes_from_ellipsoid(ellipsoid), count=120)
        box = oracle.bounding_box(exact.camera, poses[exact.detections.pose[row]], surface)
        np.testing.assert_allclose(exact.detections.box[row], box, atol=0.1)


def test_odometry_errs_alike_on_every_axis(runs):
    error = []
    for recording, truth in runs:
        true = np.linalg.inv(matrices(truth.poses)[:-1]) @ matrices(truth.poses)[1:]
        measured = matrices(recording.odometry.relative)
        turned = np.einsum("nji,njk->nik", true[:, :3, :3], measured[:, :3, :3])
        rotation = Rotation.from_matrix(turned).as_rotvec()
        error.append(np.hstack([measured[:, :3, 3] - true[:, :3, 3], rotation]))
        np.testing.assert_array_equal(recording.odometry.first_pose, truth.poses[0])
        expected = np.tile(1e-4 * np.eye(6), (149, 1, 1))
        np.testing.assert_allclose(recording.odometry.covariance, expected, atol=1e-18)
    error = np.vstack(error)
    np.testing.assert_allclose(error.mean(axis=0), 0.0, atol=1e-3)
    np.testing.assert_allclose(error.std(axis=0), 0.01, rtol=0.06)


def test_relative_positions_are_in_the_cameras_mount(runs):
    recording, truth = runs[0]
    positions = recording.positions
    inverse = np.linalg.inv(matrices(truth.poses))[positions.pose]
    center = truth.centers[positions.object_id]
    expected = np.einsum("nij,nj->ni", inverse[:, :3, :3], center) + inverse[:, :3, 3]
    error = positions.object_in_robot - expected
    np.testing.assert_allclose(error.std(axis=0), 0.02, rtol=0.06)
    np.testing.assert_allclose(error.mean(axis=0), 0.0, atol=0.003)


def test_the_path_has_its_own_numbers(runs):
    _, truth = runs[0]
    _, louder = simulate(changed("path", height_sigma_m=0.2), seed=0)
    np.testing.assert_array_equal(truth.centers, louder.centers)
    np.testing.assert_allclose(louder.poses[:, 2] - 0.6, 2.0 * (truth.poses[:, 2] - 0.6))
    assert np.abs(truth.poses - runs[1][1].poses).max() > 0.1


def test_an_orbit_through_its_axis_is_refused():
    with pytest.raises(ValueError, match=r"path\.distance_sigma_m: the orbit wobbles through"):
        simulate(changed("path", distance_sigma_m=3.0), seed=0)


# --- flights -------------------------------------------------------------------------------------

FLIGHT = load_scenario("flight")
STEADY = {"roll_sigma_deg": 0.0, "pitch_sigma_deg": 0.0, "yaw_sigma_deg": 0.0}


def flown(**values):
    path = FLIGHT.path.model_copy(update=values)
    return simulate(FLIGHT.model_copy(update={"path": path}), seed=0)[1].poses


def test_a_flight_goes_around_an_ellipse_in_equal_steps():
    poses = flown(**STEADY)
    np.testing.assert_allclose((poses[:, 0] / 10.0) ** 2 + (poses[:, 1] / 6.0) ** 2, 1.0, atol=1e-5)
    np.testing.assert_allclose(poses[[0, -1], :3], [[10.0, 0.0, 3.0]] * 2, atol=1e-6)
    steps = np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=2e-3)
    # Ramanujan: the ellipse is 51.054 m long, and twice that are 340 steps of 0.3 m.
    assert steps.mean() * len(steps) == pytest.approx(2.0 * 51.054, rel=1e-3)
    assert len(steps) == 340
    assert np.ptp(poses[:, 2]) == pytest.approx(2.0, rel=1e-3)


def test_a_flight_looks_along_its_path_and_leans_into_the_turn():
    matrix = matrices(flown(**STEADY))
    direction = matrix[2:, :3, 3] - matrix[:-2, :3, 3]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    forward = matrix[1:-1, :3, 0]
    assert (direction * forward).sum(axis=1).min() > 0.999
    # Left goes down by the sine of the bank, where the path is level.
    level = np.abs(forward[:, 2]) < 0.02
    np.testing.assert_allclose(matrix[1:-1, 2, 1][level], -np.sin(np.deg2rad(15.0)), atol=1e-3)


def test_a_flight_wobbles_as_much_as_it_says():
    steady, free = matrices(flown(**STEADY)), matrices(flown(**STEADY | {"yaw_sigma_deg": 10.0}))
    turned = np.einsum("nji,njk->nik", steady[:, :3, :3], free[:, :3, :3])
    angle = Rotation.from_matrix(turned).magnitude()
    assert np.rad2deg(np.sqrt((angle**2).mean())) == pytest.approx(10.0, rel=0.35)
    assert np.rad2deg(np.abs(np.diff(angle)).max()) < 2.0


def test_the_part_of_a_lap():
    poses = flown(laps=0.5, **STEADY)
    np.testing.assert_allclose(poses[-1, :3], [-10.0, 0.0, 3.0], atol=1e-4)
