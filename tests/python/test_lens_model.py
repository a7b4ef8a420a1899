"""Lens models, against OpenCV and by hand."""

import numpy as np
import pytest

from dqslam import Camera, Lens, LensCamera
from dqslam.lens import PARAMETERS, camera_with, ideal_pixels, lens_of, recorded_pixels

LENSES = {
    "plumb_bob": (-0.28, 0.07, 2e-4, 2e-5, 0.01),
    "rational": (0.5, -2.7, 5e-4, -2e-4, 1.5, 0.38, -2.5, 1.4),
    "thin_prism": (0.1, -0.2, 3e-3, -4e-3, 0.05, 0.02, 0.01, 3e-3, 2e-3, -1e-3, 3e-3, 1e-3),
    "equidistant": (-0.013, 0.02, -0.01, 0.002),
    "fov": (0.9,),
    "thin_prism_fisheye": (-0.013, 0.02, 1e-3, -2e-3, -0.01, 2e-3, 1e-3, 5e-4),
}
WIDEST = {"equidistant": 3.0, "fov": 3.0, "thin_prism_fisheye": 3.0}


def lens(model):
    return Lens(model, LENSES[model])


def points(model, count=2000):
    reach = WIDEST.get(model, 0.6)
    return np.random.default_rng(0).uniform(-reach, reach, (count, 2))


@pytest.mark.parametrize("model", ["plumb_bob", "rational", "thin_prism"])
def test_polynomials_are_those_of_opencv(model):
    cv2 = pytest.importorskip("cv2", reason="needs opencv-python-headless")
    ideal = points(model)
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    coefficients = np.array(LENSES[model])
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), coefficients)
    np.testing.assert_allclose(lens(model).distort(ideal), expected[:, 0], rtol=0, atol=1e-12)


def test_equidistant_is_opencvs_fisheye():
    cv2 = pytest.importorskip("cv2", reason="needs opencv-python-headless")
    ideal = points("equidistant")
    coefficients = np.array(LENSES["equidistant"])
    expected = cv2.fisheye.distortPoints(ideal[:, None], np.eye(3), coefficients)[:, 0]
    recorded = lens("equidistant").distort(ideal)
    np.testing.assert_allclose(recorded, expected, rtol=0, atol=1e-12)
    back = cv2.fisheye.undistortPoints(expected[:, None], np.eye(3), coefficients)[:, 0]
    near = np.linalg.norm(ideal, axis=1) < 1.5  # OpenCV's own iterations end early further out
    np.testing.assert_allclose(
        lens("equidistant").undistort(expected)[near], back[near], rtol=0, atol=1e-6
    )


def test_the_other_fisheyes_by_hand():
    # Devernay and Faugeras: r_d = atan(2 r tan(omega / 2)) / omega.
    expected = np.arctan(2 * 0.5 * np.tan(0.45)) / 0.9
    np.testing.assert_allclose(lens("fov").distort([0.3, 0.4]), [0.6 * expected, 0.8 * expected])
    # COLMAP: the angle takes the place of the radius, then k1 k2 p1 p2 k3 k4 sx1 sy1.
    k1, k2, p1, p2, k3, k4, sx1, sy1 = LENSES["thin_prism_fisheye"]
    angle = np.arctan(0.5)
    x, y = 0.6 * angle, 0.8 * angle
    s = angle**2
    radial = 1 + k1 * s + k2 * s**2 + k3 * s**3 + k4 * s**4
    u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x) + sx1 * s
    v = y * radial + 2 * p2 * x * y + p1 * (s + 2 * y * y) + sy1 * s
    np.testing.assert_allclose(lens("thin_prism_fisheye").distort([0.3, 0.4]), [u, v], rtol=1e-14)


@pytest.mark.parametrize("model", LENSES)
def test_undistorting_inverts_distorting(model):
    ideal = np.concatenate([points(model), np.zeros((1, 2)), [[0.0, 0.3]]])
    recorded = lens(model).distort(ideal)
    assert np.isfinite(recorded).all()
    np.testing.assert_allclose(lens(model).undistort(recorded), ideal, rtol=0, atol=1e-11)


@pytest.mark.parametrize("model", LENSES)
def test_derivatives(model):
    ideal, step = np.array([[0.2, -0.3], [0.0, 0.0], [0.4, 0.1]]), 1e-6
    _, jacobian = lens(model).differentiate(ideal)
    for axis, unit in enumerate(np.eye(2)):
        ahead = lens(model).distort(ideal + step * unit)
        behind = lens(model).distort(ideal - step * unit)
        np.testing.assert_allclose(jacobian[..., axis], (ahead - behind) / (2 * step), atol=1e-9)


def test_beyond_the_radius_where_the_lens_turns_back_there_is_nothing():
    # r (1 - 0.5 r^2) grows up to r = sqrt(2 / 3), where it is 0.5443.
    lens = Lens("plumb_bob", (-0.5, 0.0, 0.0, 0.0, 0.0))
    limit, highest = np.sqrt(2 / 3), np.sqrt(2 / 3) * 2 / 3
    given = np.array([limit - 1e-3, limit + 1e-3, 2.0])
    recorded = lens.distort(np.column_stack([given, 0 * given]))
    np.testing.assert_array_equal(np.isnan(recorded[:, 0]), [False, True, True])
    ideal = lens.undistort([[highest - 1e-6, 0.0], [highest + 1e-6, 0.0], [5.0, 0.0]])
    np.testing.assert_array_equal(np.isnan(ideal[:, 0]), [False, True, True])
    # A fisheye's image ends where the rays are parallel to that of the pinhole.
    fisheye = Lens("equidistant", (0.0, 0.0, 0.0, 0.0))
    ideal = fisheye.undistort([[1.5, 0.0], [1.6, 0.0]])
    np.testing.assert_allclose(ideal, [[np.tan(1.5), 0.0], [np.nan, np.nan]])


def test_cameras_refuse_points_beyond_the_lens():
    camera = camera_with(
        Camera(500, 500, 319.5, 239.5, 640, 480), Lens("rational", (-0.5, 0, 0, 0, 0, 0, 0, 0))
    )
    assert camera.undistort_points([[319.5, 239.5], [500.0, 239.5]])[0].tolist() == [319.5, 239.5]
    with pytest.raises(ValueError, match="points row 1: beyond the range of the lens"):
        camera.undistort_points([[319.5, 239.5], [639.0, 239.5]])
    with pytest.raises(ValueError, match="points row 0: beyond the range of the lens"):
        camera.distort_points([[900.0, 239.5]])


def test_a_camera_behind_a_lens():
    mount = [0.2, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5]
    pinhole = Camera(500, 510, 319.5, 239.5, 640, 480, robot_from_camera=mount)
    camera = camera_with(pinhole, lens("equidistant"))
    assert isinstance(camera, LensCamera) and camera.has_distortion
    assert camera.distortion.tolist() == list(LENSES["equidistant"])
    assert camera.robot_from_camera.tolist() == mount
    assert repr(camera) == (
        "LensCamera(640 x 480 px, fx=500, fy=510, cx=319.5, cy=239.5, equidistant)"
    )
    pixels = np.array([[100.0, 50.0], [600.0, 400.0]])
    normalized = (pixels - [319.5, 239.5]) / [500, 510]
    expected = lens("equidistant").distort(normalized) * [500, 510] + [319.5, 239.5]
    np.testing.assert_allclose(camera.distort_points(pixels), expected)
    np.testing.assert_allclose(camera.undistort_points(expected), pixels)
    assert lens_of(camera) == lens("equidistant")
    # The core's own lens is that of five numbers.
    same = camera_with(pinhole, lens("plumb_bob"))
    assert type(same) is Camera
    np.testing.assert_allclose(recorded_pixels(same, pixels), same.distort_points(pixels))
    np.testing.assert_allclose(ideal_pixels(same, pixels), same.undistort_points(pixels))


@pytest.mark.parametrize(
    ("model", "parameters", "message"),
    [
        ("omni", (1.0,), "lens model 'omni' is none of plumb_bob, rational"),
        ("equidistant", (1.0, 2.0), "equidistant has 4 parameters, k1 k2 k3 k4, got 2"),
        ("fov", (np.nan,), "fov: a parameter is not finite"),
        ("fov", (0.0,), "fov: omega is 0, not between 0 and pi"),
    ],
)
def test_wrong_lenses(model, parameters, message):
    with pytest.raises(ValueError, match=message):
        Lens(model, parameters)


def test_ideal_lenses():
    assert Lens("rational", (0.0,) * 8).is_ideal
    assert not Lens("equidistant", (0.0,) * 4).is_ideal
    assert set(LENSES) == set(PARAMETERS)
