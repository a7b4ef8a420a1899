"""Truncated signed distances by hand: planes, space that is seen as free, pixels without depth."""

import numpy as np
import pytest

import dqslam as dq
from depth_scenes import at, cast, look_at, results_of
from dqslam.surface.body import Body, bodies_of
from dqslam.surface.views import View, Views, known_times
from dqslam.surface.volume import Volume

CAMERA = dq.Camera(100.0, 100.0, 49.5, 39.5, 100, 80)
BODY = Body(np.array([0.0, 0.0, 1.0]), np.eye(3), semi_axes=np.ones(3), reach=np.ones(3))


def volume():
    """Return 9 x 9 x 21 voxels of 1 cm around a point 1 m ahead, truncated at 4 cm."""
    made = Volume(BODY, 0.01, 0.04, np.array([0.04, 0.04, 0.1]), noise=0.002)
    made.make()
    return made


def view(depth):
    return View(CAMERA, np.asarray(depth, dtype=np.float32), np.zeros(3), np.eye(3))


def flat(depth):
    return view(np.full((80, 100), depth))


def test_distances_of_a_plane_that_faces_the_camera():
    made = volume()
    made.integrate(flat(1.0))
    column = made.distance[4, 4]  # voxels at depths 0.90, 0.91, ... 1.10 m
    np.testing.assert_allclose(column[:6], 1.0)  # 4 cm and more before it: free
    np.testing.assert_allclose(column[6:14], np.arange(1.0, -1.0, -0.25), atol=1e-4)
    seen = made.is_seen[4, 4]
    assert seen[:14].all()
    assert not seen[15:].any()  # behind the truncation, 1.04 m, nothing is known
    assert made.images == 1


def test_distances_of_a_slanted_plane_are_along_its_normal():
    """Of the plane z = 1 + x tan 30 deg."""
    made = volume()
    rays = (np.arange(100) - 49.5) / 100.0
    made.integrate(view(np.tile(1.0 / (1.0 - rays * np.tan(np.pi / 6)), (80, 1))))
    points = made.points(np.argwhere(made.is_seen)) + BODY.center
    true = (1.0 + points[:, 0] * np.tan(np.pi / 6) - points[:, 2]) * np.cos(np.pi / 6) / 0.04
    near = np.abs(true) < 0.9
    assert near.sum() > 300
    np.testing.assert_allclose(made.distance[made.is_seen][near], true[near], atol=0.02)


def test_the_mean_is_weighted_by_the_inverse_variance_of_depth():
    """Sigma grows with depth squared, so weights are 1 / depth^4."""
    made = volume()
    made.integrate(flat(0.99))
    made.integrate(flat(1.01))
    near, far = 0.99**-4, 1.01**-4
    wanted = (near * -0.25 + far * 0.25) / (near + far)
    assert made.distance[4, 4, 10] == pytest.approx(wanted, abs=1e-4)


def test_what_is_seen_as_free_is_free_whatever_hides_it_elsewhere():
    """A voxel 2 cm behind what one image shows, and clearly before what another shows."""
    made = volume()
    made.integrate(flat(0.98))
    assert made.distance[4, 4, 10] == pytest.approx(-0.5, abs=1e-4)
    made.integrate(flat(1.5))
    assert made.distance[4, 4, 10] == 1.0


def test_pixels_without_depth_say_nothing():
    made = volume()
    made.integrate(flat(0.0))
    assert not made.is_seen.any()
    assert made.images == 0


def test_a_volume_beside_the_image_or_behind_the_camera_sees_nothing():
    for center in ([5.0, 0.0, 1.0], [0.0, 0.0, -1.0]):
        body = Body(np.array(center), np.eye(3), np.ones(3), np.ones(3))
        made = Volume(body, 0.01, 0.04, np.full(3, 0.05), noise=0.002)
        made.make()
        made.integrate(flat(1.0))
        assert not made.is_seen.any()


def test_images_that_may_see_a_sphere():
    poses = np.array([look_at(np.array([2.0, 0.0, 0.0]), np.zeros(3))])
    things = [at(0, 0, 0, half=(0.2, 0.2, 0.2))]
    depth = dq.DepthImages.from_arrays([0.0], cast(poses, things))
    results = results_of(poses, things)
    views = Views.along(results.camera, results.timestamps, results.poses, depth)
    # Half the image is 160 px of a focal length of 300 px: 1.067 m at 2 m.
    assert views.see(0, np.array([0.0, 1.0, 0.0]), 0.0)
    assert not views.see(0, np.array([0.0, 1.2, 0.0]), 0.05)
    assert views.see(0, np.array([0.0, 1.2, 0.0]), 0.2)
    assert not views.see(0, np.array([3.0, 0.0, 0.0]), 0.5)


def test_bodies_are_those_of_the_map():
    thing = at(1.0, 2.0, 3.0, half=(0.3, 0.2, 0.1), yaw=0.5)
    found = bodies_of(results_of(np.zeros((1, 7)), [thing]).objects)[0]
    point = thing.center + thing.turn @ [0.3, 0.0, 0.0]
    np.testing.assert_allclose(found.to_object(point), [0.3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.to_world(found.to_object(point)), point, atol=1e-12)
    assert found.radius(found.to_object(point)) == pytest.approx(1.0)
    assert found.support(np.array([0.6, 0.8, 0.0])) == pytest.approx(np.hypot(0.18, 0.16))


def test_times_at_which_the_pose_is_known():
    """Poses each second, with a gap of ten; half a second from a pose is near."""
    poses = np.array([0.0, 1.0, 2.0, 3.0, 13.0, 14.0])
    times = np.array([-0.6, -0.4, 0.0, 1.5, 3.4, 8.0, 12.6, 14.5, 14.6])
    np.testing.assert_array_equal(known_times(poses, times), [1, 2, 3, 4, 6, 7])
