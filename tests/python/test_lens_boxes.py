"""Boxes through lenses, against boxes around many points of the surface."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera, PoseModel, _core
from dqslam.lens import (
    Lens,
    camera_with,
    distort_boxes,
    edge_scales,
    outline_tilts,
    recorded_pixels,
    undistort_boxes,
    undistorted_or_nan,
)
from test_lens_model import LENSES, lens

SURFACE_POINTS = 100_000
FOCAL = {"equidistant": 200.0, "thin_prism_fisheye": 200.0, "fov": 300.0}
HERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def camera_of(model):
    focal = FOCAL.get(model, 525.0)
    return camera_with(Camera(focal, focal, 319.5, 239.5, 640, 480), lens(model))


def recorded_box(camera, center, axes, quaternion, rng):
    """The box around points of the surface, as recorded; None where the lens sees not all."""
    points = rng.normal(size=(SURFACE_POINTS, 3))
    points *= axes / np.linalg.norm(points, axis=1)[:, None]
    points = center + points @ Rotation.from_quat(quaternion).as_matrix().T
    ideal = points[:, :2] / points[:, 2:] * camera.fx + [camera.cx, camera.cy]
    pixels = recorded_pixels(camera, ideal)
    box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    inside = np.all(box[:2] > 0) and np.all(box[2:] < [639, 479])  # false for NaN
    return box if inside and points[:, 2].min() > 0.1 else None


def scene(model, count=8):
    """Ellipsoids (o, 9) all over the image of a camera, and their boxes as recorded."""
    camera, rng = camera_of(model), np.random.default_rng(5)
    ellipsoids, boxes = [], []
    while len(boxes) < count:
        pixel = camera.undistort_points([rng.uniform([40, 40], [600, 440])])[0]
        ray = np.array([*(pixel - [camera.cx, camera.cy]) / camera.fx, 1.0])
        if np.linalg.norm(ray) > 4.0:
            continue
        center = ray / np.linalg.norm(ray) * rng.uniform(1.0, 3.0)
        axes, quaternion = rng.uniform(0.08, 0.4, 3), rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        box = recorded_box(camera, center, axes, quaternion, rng)
        if box is not None:
            ellipsoids.append(_core.ellipsoid_from_axes(center, axes, quaternion))
            boxes.append(box)
    return camera, np.array(ellipsoids), np.array(boxes)


@pytest.mark.parametrize("model", LENSES)
def test_boxes_are_exact_with_the_tilts_of_the_objects(model):
    camera, ellipsoids, recorded = scene(model)
    poses = np.tile(HERE, (len(ellipsoids), 1))
    ideal, in_front = _core.project_to_boxes(PoseModel.SE3, camera, poses, ellipsoids)
    assert in_front.all()
    tilts = outline_tilts(PoseModel.SE3, camera, poses, ellipsoids)
    # The points lie within the surface's true box, by up to some hundredths of a pixel.
    np.testing.assert_allclose(distort_boxes(camera, ideal, tilts), recorded, rtol=0, atol=0.05)
    found = undistort_boxes(camera, recorded, tilts)
    error = np.abs(found - ideal)
    assert (error / edge_scales(camera, ideal)).max() < 0.05
    assert np.median(error) < 0.02
    # With the tilts of spheres, some are off by pixels.
    assert np.abs(undistort_boxes(camera, recorded) - ideal).max() > 10 * error.max()


@pytest.mark.parametrize("model", LENSES)
@pytest.mark.parametrize("tilt", [np.nan, 0.3, -0.5])
def test_undistorting_and_distorting_invert_each_other(model, tilt):
    camera, _, recorded = scene(model, count=4)
    ideal = undistort_boxes(camera, recorded, tilt)
    np.testing.assert_allclose(distort_boxes(camera, ideal, tilt), recorded, rtol=0, atol=1e-7)


def test_tilts_by_hand():
    # A sphere on the optical axis has a circle for its outline. One at (1, 1, 2) is drawn out along
    # the diagonal: the dual conic is p p^T - r^2 I.
    sphere = _core.ellipsoid_from_axes([0, 0, 2], [0.5] * 3, [0, 0, 0, 1])
    aside = _core.ellipsoid_from_axes([1, 1, 2], [0.5] * 3, [0, 0, 0, 1])
    behind = _core.ellipsoid_from_axes([0, 0, -2], [0.5] * 3, [0, 0, 0, 1])
    camera = camera_of("plumb_bob")
    found = outline_tilts(
        PoseModel.SE3, camera, np.tile(HERE, (3, 1)), np.array([sphere, aside, behind])
    )
    dual = np.outer([1, 1, 2], [1, 1, 2]) - 0.25 * np.eye(3)
    middle = dual[:2, 2] / dual[2, 2]
    spread = np.outer(middle, middle) - dual[:2, :2] / dual[2, 2]
    expected = spread[0, 1] / spread[0, 0]
    np.testing.assert_allclose(found[:2], [0.0, expected], atol=1e-12)
    assert np.isnan(found[2])


@pytest.mark.parametrize("model", LENSES)
def test_boxes_of_small_spheres_need_no_tilts(model):
    camera = camera_of(model)
    directions = np.array([[0.0, 0.0], [0.3, -0.2], [-0.5, 0.35], [0.1, 0.45]])
    spheres = np.array(
        [_core.ellipsoid_from_axes([*xy, 1.0], [0.02] * 3, [0, 0, 0, 1]) for xy in directions]
    )
    poses = np.tile(HERE, (len(spheres), 1))
    ideal, _ = _core.project_to_boxes(PoseModel.SE3, camera, poses, spheres)
    tilts = outline_tilts(PoseModel.SE3, camera, poses, spheres)
    recorded = distort_boxes(camera, ideal, tilts)
    np.testing.assert_allclose(undistort_boxes(camera, recorded), ideal, rtol=0, atol=0.1)


def test_edge_scales_are_those_of_small_boxes():
    camera = camera_of("equidistant")
    ideal = np.array([[300.0, 200.0, 300.2, 200.2], [900.0, 200.0, 900.2, 200.2]])
    moved = ideal + [0.1, 0.0, 0.1, 0.0]
    shift = distort_boxes(camera, moved) - distort_boxes(camera, ideal)
    scales = edge_scales(camera, ideal)
    np.testing.assert_allclose(0.1 / shift[:, 0], scales[:, 0], rtol=0.05)
    assert scales[1, 0] > 5.0
    assert edge_scales(Camera(500, 500, 320, 240, 640, 480), ideal).tolist() == [[1.0] * 4] * 2


def test_boxes_beyond_the_lens_are_refused():
    camera = camera_with(
        Camera(500, 500, 319.5, 239.5, 640, 480),
        Lens("plumb_bob", (-0.5, 0.0, 0.0, 0.0, 0.0)),
    )
    boxes = np.array([[300.0, 200.0, 340.0, 260.0], [560.0, 200.0, 639.0, 260.0]])
    found = undistorted_or_nan(camera, boxes)
    np.testing.assert_array_equal(np.isnan(found).any(axis=1), [False, True])
    with pytest.raises(ValueError, match="boxes row 1: it reaches beyond the range of the lens"):
        undistort_boxes(camera, boxes)
    with pytest.raises(ValueError, match="boxes row 0: it reaches beyond the range of the lens"):
        distort_boxes(camera, [[2000.0, 2000.0, 3000.0, 3000.0]])
    with pytest.raises(ValueError, match="tilt row 0: not between -1 and 1"):
        undistort_boxes(camera, boxes[:1], 1.0)


def test_without_a_lens_boxes_stay():
    camera = Camera(500, 500, 319.5, 239.5, 640, 480)
    box = np.array([[1.0, 2.0, 30.0, 40.0]])
    np.testing.assert_array_equal(undistort_boxes(camera, box), box)
    np.testing.assert_array_equal(distort_boxes(camera, box), box)
