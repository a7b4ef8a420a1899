"""Outlines against the exact box of the core, and against sampled surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import _core
from dqslam.metrics import through_lens, visible_outlines
from dqslam.solids import Solids
from oracle import ellipsoid_surface, se3_matrix, to_pixels

CAMERA = _core.Camera(500.0, 510.0, 321.0, 239.0, 640, 480)
RANDOM = np.random.default_rng(5)
COUNT = 50
POSES = np.hstack(
    [RANDOM.normal(size=(COUNT, 3)), Rotation.random(COUNT, random_state=1).as_quat()]
)
# Anywhere in the image, and beyond its border: at most 45 degrees off the axis.
IN_CAMERA = RANDOM.uniform([-2, -2, 3], [2, 2, 8], (COUNT, 3))
CENTERS = POSES[:, :3] + Rotation.from_quat(POSES[:, 3:]).apply(IN_CAMERA)
AXES = -np.sort(-RANDOM.uniform(0.05, 1.5, (COUNT, 3)))
TURNS = Rotation.random(COUNT, random_state=2).as_quat()
ELLIPSOIDS = np.array(
    [_core.ellipsoid_from_axes(*one) for one in zip(CENTERS, AXES, TURNS, strict=True)]
)


def project_outlines(camera, poses, ellipsoids, **options):
    return _core.project_to_outlines(_core.PoseModel.SE3, camera, poses, ellipsoids, **options)


def test_each_side_of_the_box_touches_the_outline():
    outlines = project_outlines(CAMERA, POSES, ELLIPSOIDS)
    box, in_front = _core.project_to_boxes(_core.PoseModel.SE3, CAMERA, POSES, ELLIPSOIDS)
    assert in_front.all()
    assert outlines.shape == (COUNT, 128, 2)
    touched = np.hstack([outlines.min(axis=1), outlines.max(axis=1)])
    size = (box[:, 2:] - box[:, :2]).max(axis=1, keepdims=True)
    assert (np.abs(touched - box) < 0.5 * size / 600.0).all()
    np.testing.assert_allclose(outlines[:, 0], outlines[:, -1], rtol=1e-12)


@pytest.mark.parametrize("row", range(5))
def test_the_outline_holds_the_surface_and_no_more(row):
    surface = ellipsoid_surface(CENTERS[row], AXES[row], TURNS[row])
    pixels, _ = to_pixels(CAMERA, se3_matrix(POSES[row]), surface)
    (outline,) = project_outlines(CAMERA, POSES[[row]], ELLIPSOIDS[[row]])
    for angle in np.linspace(0.0, np.pi, 7):
        across = np.array([np.cos(angle), np.sin(angle)])
        spread = np.ptp(pixels @ across)
        assert (outline @ across).max() == pytest.approx((pixels @ across).max(), abs=1e-3 * spread)
        assert (outline @ across).min() == pytest.approx((pixels @ across).min(), abs=1e-3 * spread)


def test_a_sphere_straight_ahead_by_hand():
    sphere = _core.ellipsoid_from_axes([0, 0, 5], [3, 3, 3], [0, 0, 0, 1])
    pose = np.array([[0, 0, 0, 0, 0, 0, 1.0]])
    (outline,) = project_outlines(CAMERA, pose, sphere[None], points=5)
    # The tangent cone of a sphere of radius 3 at 5 has a slope of 3 / 4.
    across, down = np.array([375.0, 382.5]), outline - [321, 239]
    np.testing.assert_allclose(np.linalg.norm(down / across, axis=1), 1.0)
    np.testing.assert_allclose(np.abs(down).max(axis=0), across)


def test_a_speck_far_away_is_a_point():
    speck = _core.ellipsoid_from_axes([300, 200, 900], [1e-7, 1e-7, 1e-7], [0, 0, 0, 1])
    (outline,) = project_outlines(CAMERA, np.array([[0, 0, 0, 0, 0, 0, 1.0]]), speck[None])
    expected = np.tile([321 + 500 / 3, 239 + 510 * 2 / 9], (128, 1))
    np.testing.assert_allclose(outline, expected, atol=1e-3)


@pytest.mark.parametrize("depth", [-5.0, 0.0, 2.9])
def test_what_is_behind_or_around_the_camera_has_no_outline(depth):
    sphere = _core.ellipsoid_from_axes([0, 0, depth], [3, 3, 3], [0, 0, 0, 1])
    rows = np.array([sphere, np.full(9, np.nan)])
    pose = np.array([[0, 0, 0, 0, 0, 0, 1.0]] * 2)
    assert np.isnan(project_outlines(CAMERA, pose, rows)).all()
    assert project_outlines(CAMERA, pose[:0], rows[:0]).shape == (0, 128, 2)


def test_what_the_image_shows_comes_from_far_to_near():
    places = [[0, 0, 4], [0, 0, -4], [0.5, 0, 9], [9, 0, 4], [-1, 0, 6]]
    ellipsoids = [_core.ellipsoid_from_axes(place, [0.3] * 3, [0, 0, 0, 1]) for place in places]
    solids = Solids.of_ellipsoids(np.array([*ellipsoids, [np.nan] * 9]))
    rows, outlines = visible_outlines(CAMERA, np.eye(7)[6], solids)
    np.testing.assert_array_equal(rows, [2, 4, 0])
    here = np.tile(np.eye(7)[6], (3, 1))
    expected = project_outlines(CAMERA, here, np.array(ellipsoids)[rows])
    np.testing.assert_array_equal(outlines, expected)
    rows, outlines = visible_outlines(CAMERA, np.eye(7)[6], solids.take([]), points=7)
    assert (rows.shape, outlines.shape) == ((0,), (0, 7, 2))


def test_the_lens_bends_what_the_image_shows_and_nothing_far_from_it():
    lens = _core.Camera(
        520, 521, 325, 249, 640, 480, distortion=[0.231, -0.785, -0.003, -0.0001, 0.917]
    )
    points = np.array([[[325.0, 249.0], [100, 100], [np.nan, np.nan], [1e5, 200]]])
    bent = through_lens(lens, points)
    np.testing.assert_allclose(bent[0, 0], [325, 249])
    np.testing.assert_allclose(lens.undistort_points(bent[0, :2]), points[0, :2], atol=1e-6)
    assert not np.allclose(bent[0, 1], points[0, 1], atol=0.5)
    assert np.isnan(bent[0, 2:]).all()
    np.testing.assert_array_equal(through_lens(CAMERA, points), points)
