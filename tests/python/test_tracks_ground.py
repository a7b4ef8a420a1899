"""The ground by where things stand: below a vehicle's camera, level, or unknown."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera, _core
from dqslam.tracks.ground import (
    LEAST_SIGMA_M,
    UNKNOWN_SIGMA_M,
    Feet,
    feet_of_boxes,
    feet_of_ellipsoids,
    find_ground,
)

AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def drive(slope, count=60):
    """A camera 1.6 m above a street that rises by ``slope`` along x, and 12 feet beside it."""
    x = np.arange(count, dtype=float)
    tilt = Rotation.from_euler("y", -np.arctan(slope)).as_matrix()
    poses = np.zeros((count, 7))
    poses[:, 0], poses[:, 2] = x, slope * x
    poses[:, :3] += 1.6 * tilt[:, 2]
    poses[:, 3:] = Rotation.from_matrix(tilt @ AHEAD).as_quat()
    random = np.random.default_rng(0)
    place = np.column_stack([random.uniform(20, 60, 12), random.uniform(-8, 8, 12), np.zeros(12)])
    place[:, 2] = slope * place[:, 0] + 0.02 * random.normal(size=12)
    image = np.repeat(np.arange(10), 12)
    return poses, Feet(
        np.tile(np.arange(12), 10), image, np.tile(place, (10, 1)), np.full(120, 0.02)
    )


@pytest.mark.parametrize("slope", [0.0, 0.08])
def test_a_vehicle_s_ground_is_below_its_camera(slope):
    poses, feet = drive(slope)
    ground = find_ground(poses, feet)
    assert ground.feet == 12
    if slope:
        assert ground.kind == "below the camera"
        assert ground.height_m == pytest.approx(1.6, abs=0.03)
    # 15 m ahead of a camera, 3 m to its left, the ground is where the street is.
    turn = ground.world_from_ground
    axes = Rotation.from_quat(poses[:, 3:]).as_matrix()
    planes = ground.planes(turn.T @ axes, poses[:, :3] @ turn)
    x, y = (np.array([poses[20, 0] + 15.0, 3.0, slope * (poses[20, 0] + 15.0)]) @ turn)[:2]
    expected = (np.array([poses[20, 0] + 15.0, 3.0, slope * (poses[20, 0] + 15.0)]) @ turn)[2]
    assert planes[20] @ [1.0, x, y] == pytest.approx(expected, abs=0.05)


def test_the_ground_of_a_camera_in_the_hand_is_level():
    random = np.random.default_rng(1)
    poses = np.zeros((40, 7))
    poses[:, :3] = random.uniform(-1, 1, (40, 3)) + [0.0, 0.0, 1.5]
    turns = Rotation.from_euler("z", random.uniform(-3, 3, (40, 1))).as_matrix()
    poses[:, 3:] = Rotation.from_matrix(turns @ AHEAD).as_quat()
    place = np.column_stack([random.uniform(-4, 4, (10, 2)), 0.25 + 0.01 * random.normal(size=10)])
    feet = Feet(
        np.tile(np.arange(10), 40),
        np.repeat(np.arange(40), 10),
        np.tile(place, (40, 1)),
        np.full(400, 0.01),
    )
    ground = find_ground(poses, feet)
    assert ground.kind == "level" and ground.height_m == pytest.approx(0.25, abs=0.02)
    assert ground.sigma_m == pytest.approx(LEAST_SIGMA_M)


def test_two_things_show_no_ground():
    poses, feet = drive(0.0)
    two = feet.thing < 2
    ground = find_ground(
        poses, Feet(feet.thing[two], feet.image[two], feet.place[two], feet.sigma[two])
    )
    assert ground.kind == "unknown"
    assert ground.sigmas(np.zeros((1, 3)))[0] == pytest.approx(UNKNOWN_SIGMA_M, rel=1e-3)


def test_things_that_move_correct_the_ground_by_their_weights():
    """Ground 0.1 m sure, one thing 0.3 m above it with 0.1 m: half way, if its own scatter is 0."""
    poses, feet = drive(0.0)
    ground = find_ground(poses, feet)
    own, common = ground.sigma_m**2, ground.common_sigma_m**2
    after = ground.corrected(np.array([0.3]), np.array([0.01]), np.zeros(1))
    weight = 1.0 / (0.01 + own)
    rise = 0.3 * weight / (weight + 1.0 / common)
    way = -1.0 if ground.kind == "below the camera" else 1.0
    assert after.height_m - ground.height_m == pytest.approx(way * rise)
    assert after.common_sigma_m**-2 == pytest.approx(1.0 / common + weight)


def test_feet_of_boxes_and_ellipsoids():
    camera = Camera(500.0, 500.0, 320.0, 240.0, 640, 480)
    pose = np.array([[0.0, 0.0, 1.0, *Rotation.from_matrix(AHEAD).as_quat()]])
    # 2 m high at 10 m: 100 px; its foot 1 m below the camera is 50 px below the middle.
    box = np.array([[300.0, 190.0, 340.0, 290.0]])
    found = feet_of_boxes(camera, pose, box, np.ones(1, dtype=bool), np.array([2.0]))
    np.testing.assert_allclose(found, [[10.0, 0.0, 0.0]], atol=1e-12)
    ball = _core.ellipsoid_from_axes([1.0, 2.0, 3.0], [0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0])
    lowest = feet_of_ellipsoids(ball[None], np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(lowest, [[1.0, 2.0, 2.5]])
