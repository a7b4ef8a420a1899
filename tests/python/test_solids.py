"""Solids: boxes, outlines and chi-squares of cuboids and cylinders, volumes and meshes."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core
from dqslam._core import Camera, Shape
from dqslam.metrics import solid_iou
from dqslam.solids import (
    Solids,
    box_chi_squares,
    flat_outline,
    mesh,
    project_to_boxes,
    project_to_outlines,
    wireframe,
)

CAMERA = Camera(500.0, 520.0, 320.0, 240.0, 640, 480)
SE3 = _core.PoseModel.SE3
SHAPES = (Shape.ELLIPSOID, Shape.CUBOID, Shape.CYLINDER)
AXES = np.array([0.5, 0.3, 0.8])
ORIGIN = np.array([[0.0, 0, 0, 0, 0, 0, 1]])


def solids_of(shapes=SHAPES, *, center=(0.4, -0.3, 4.0), seed=0) -> Solids:
    count = len(shapes)
    turns = Rotation.random(count, random_state=seed).as_matrix()
    return Solids.of_axes(shapes, np.tile(center, (count, 1)), np.tile(AXES, (count, 1)), turns)


def surface(solids: Solids, row: int, count: int = 400) -> np.ndarray:
    """Points of the surface: sampled here from the definition of the three unit solids."""
    around, along = np.linspace(0, 2 * np.pi, count), np.linspace(-1, 1, 21)
    if solids.shapes[row] == Shape.CUBOID:
        u = np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3)
    elif solids.shapes[row] == Shape.CYLINDER:
        u = np.array([[np.cos(a), np.sin(a), z] for a in around for z in (-1, 0, 1)])
    else:
        up = np.linspace(0, np.pi, count // 2)
        u = np.array(
            [[np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)] for a in around for t in up]
        )
    return solids.centers[row] + u @ solids.factors[row].T


@pytest.mark.parametrize("seed", range(5))
def test_boxes_are_those_of_the_surface(seed):
    solids = solids_of(seed=seed)
    turn = Rotation.random(random_state=seed + 50)
    pose = np.concatenate([[0.3, -1.0, 0.5], turn.as_quat()])
    moved = solids.moved(turn.as_matrix(), pose[:3])
    poses = np.tile(pose, (3, 1))
    boxes, in_front = project_to_boxes(SE3, CAMERA, poses, moved)
    outlines = project_to_outlines(SE3, CAMERA, poses, moved)
    assert in_front.all()
    for row in range(3):
        points = (surface(moved, row) - pose[:3]) @ turn.as_matrix()
        pixels = points[:, :2] / points[:, 2:] * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy]
        expected = [*pixels.min(axis=0), *pixels.max(axis=0)]
        size = np.ptp(pixels, axis=0).max()
        np.testing.assert_allclose(boxes[row], expected, atol=0.007 * size)  # rounded edges
        outline = outlines[row]
        np.testing.assert_allclose([*outline.min(axis=0), *outline.max(axis=0)], expected, atol=0.3)
        np.testing.assert_allclose(outline[0], outline[-1], atol=1e-9)
        # The outline is convex and around all of the surface.
        area = ConvexHull(pixels).volume
        assert ConvexHull(outline).volume == pytest.approx(area, rel=5e-3)


def test_a_box_by_hand():
    """A cube with sides of 2 m at 5 m: its front is at 4 m, hence +- 500 / 4 px."""
    cube = Solids.of_axes(
        (Shape.CUBOID,), np.array([[0.0, 0, 5]]), np.ones((1, 3)), np.eye(3)[None]
    )
    box, in_front = project_to_boxes(SE3, CAMERA, ORIGIN, cube)
    np.testing.assert_allclose(box[0], [195, 110, 445, 370], atol=0.15)  # rounded by 0.05 %
    assert in_front[0]
    # An upright can (its axis is -y of the camera): the nearest rim point is at 4 m.
    turn = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    can = Solids.of_axes((Shape.CYLINDER,), np.array([[0.0, 0, 5]]), np.ones((1, 3)), turn[None])
    box, _ = project_to_boxes(SE3, CAMERA, ORIGIN, can)
    side = 500 / np.sqrt(5**2 - 1)  # the tangent of a circle of radius 1 m at 5 m
    np.testing.assert_allclose(box[0], [320 - side, 110, 320 + side, 370], atol=0.15)


def test_what_reaches_behind_the_camera_has_no_box():
    solids = solids_of((Shape.CUBOID, Shape.CYLINDER), center=(0, 0, 0.3))
    poses = np.tile(ORIGIN, (2, 1))
    boxes, in_front = project_to_boxes(SE3, CAMERA, poses, solids)
    assert not in_front.any()
    assert np.isnan(boxes).all()
    assert np.isnan(project_to_outlines(SE3, CAMERA, poses, solids)).all()
    none = np.zeros((2, 4), dtype=bool)
    given = np.tile([100.0, 100, 200, 200], (2, 1))
    unit = np.tile(np.eye(4).ravel(), (2, 1))
    assert np.isinf(box_chi_squares(SE3, CAMERA, poses, solids, given, unit, none)).all()


def test_chi_squares_by_hand():
    solids = solids_of((Shape.CUBOID, Shape.CYLINDER))
    poses = np.tile(ORIGIN, (2, 1))
    predicted, _ = project_to_boxes(SE3, CAMERA, poses, solids)
    whole = np.zeros((2, 4), dtype=bool)
    covariances = np.tile(np.diag([1.0, 4.0, 9.0, 16.0]).ravel(), (2, 1))
    off = predicted + [2.0, -2.0, 3.0, 4.0]
    found = box_chi_squares(SE3, CAMERA, poses, solids, off, covariances, whole)
    np.testing.assert_allclose(found, 4.0 + 1.0 + 1.0 + 1.0)
    # A cut edge counts only where the prediction ends inside of the box.
    cut = np.tile([True, False, True, False], (2, 1))
    found = box_chi_squares(SE3, CAMERA, poses, solids, off, covariances, cut)
    np.testing.assert_allclose(found, 0.0 + 1.0 + 1.0 + 1.0)


def test_edges_touched_outside_the_image_bound_a_cut_box_only():
    """A thin square that stands on its corner, half out of the right border.

    At 5 m, its corners are 50 sqrt(2) px from the middle at u = 700: its left one is in the image,
    and those that touch the upper and the lower edge of its box are not.
    """
    turn = Rotation.from_euler("z", 45, degrees=True).as_matrix()
    square = Solids.of_axes(
        (Shape.CUBOID,), np.array([[3.8, 0.0, 5]]), np.array([[0.5, 0.5, 1e-6]]), turn[None]
    )
    (predicted,), _ = project_to_boxes(SE3, CAMERA, ORIGIN, square)
    left, top = 700 - 50 * np.sqrt(2), 240 - 52 * np.sqrt(2)
    np.testing.assert_allclose(predicted, [left, top, 1400 - left, 480 - top], atol=0.05)
    left, top = predicted[:2]  # with rounded edges
    seen = np.array([[left + 2.0, 230.0, 639.5, 250.0]])
    unit, whole = np.eye(4).reshape(1, 16), np.zeros((1, 4), dtype=bool)
    cut = np.array([[False, False, True, False]])
    found = box_chi_squares(SE3, CAMERA, ORIGIN, square, seen, unit, cut)
    assert found[0] == pytest.approx(4.0, abs=1e-3)
    expected = np.sum((predicted - seen[0]) ** 2)
    found = box_chi_squares(SE3, CAMERA, ORIGIN, square, seen, unit, whole)
    assert found[0] == pytest.approx(expected)
    # Where the prediction ends inside of what was seen, it is compared all the same.
    seen[0, 1] = top - 3.0
    found = box_chi_squares(SE3, CAMERA, ORIGIN, square, seen, unit, cut)
    assert found[0] == pytest.approx(4.0 + 9.0, abs=1e-3)


@pytest.mark.parametrize("shape", [Shape.CUBOID, Shape.CYLINDER])
def test_chi_squares_are_those_that_the_estimator_minimizes(shape):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=3)
    graph = dq.build_graph(recording, shapes=shape, box_noise=dq.BoxNoise(2.0, 0.0))
    options = dq.SolveOptions(loss=dq.Loss.NONE)
    estimate, _ = dq.solve(graph, options)
    core = graph.core
    state = dq.State(estimate.poses, estimate.landmarks, list(estimate.object_shapes))
    expected = _core.fit(core, options, state).box_squares
    chi2 = box_chi_squares(
        core.pose_model,
        core.camera,
        estimate.poses[core.boxes.pose],
        estimate.solids.take(core.boxes.object),
        core.boxes.box,
        core.boxes.covariance,
        core.boxes.truncated,
    )
    assert chi2.sum() == pytest.approx(expected, rel=1e-9)


def test_volumes_moments_and_supports():
    solids = solids_of()
    product = AXES.prod()
    np.testing.assert_allclose(
        solids.volumes, [4 / 3 * np.pi * product, 8 * product, 2 * np.pi * product]
    )
    random = np.random.default_rng(0)
    direction = np.array([0.6, 0.0, 0.8])
    for row in range(3):
        inside = solids.filled(row, random.random((200_000, 3)))
        assert solids.contains(row, inside).all()
        moments = np.cov(inside.T)
        stand_in = _core.ellipsoid_shapes(solids.ellipsoids[[row]])[0] / 5.0
        np.testing.assert_allclose(moments, stand_in, atol=3e-3)
        reach = ((surface(solids, row) - solids.centers[row]) @ direction).max()
        assert solids.support(direction)[row] == pytest.approx(reach, abs=2e-3)
        outside = solids.centers[row] + 1.05 * (surface(solids, row) - solids.centers[row])
        if solids.shapes[row] == Shape.ELLIPSOID:
            assert not solids.contains(row, outside).any()


def test_an_alignment_moves_all_of_a_solid():
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    solids = solids_of()
    moved = solids.moved(turn, np.array([1.0, 2.0, 3.0]), 2.0)
    np.testing.assert_allclose(moved.volumes, 8.0 * solids.volumes)
    for row in range(3):
        expected = 2.0 * surface(solids, row, 40) @ turn.T + [1.0, 2.0, 3.0]
        np.testing.assert_allclose(surface(moved, row, 40), expected)
    stand_in = _core.ellipsoid_shapes(solids.ellipsoids)
    np.testing.assert_allclose(
        _core.ellipsoid_shapes(moved.ellipsoids), 4.0 * turn @ stand_in @ turn.T, atol=1e-12
    )


def test_ellipsoids_and_what_has_no_surface():
    one = _core.ellipsoid_from_axes([1, 2, 3], AXES, [0, 0, 0, 1])
    solids = Solids.of_ellipsoids(np.array([one, np.full(9, np.nan)]))
    np.testing.assert_array_equal(solids.has_surface, [True, False])
    np.testing.assert_allclose(np.abs(solids.factors[0]).sum(axis=1), AXES)
    assert np.linalg.det(solids.factors[0]) > 0.0
    assert solids.volumes[0] == pytest.approx(4 / 3 * np.pi * AXES.prod())
    assert np.isnan(solids.volumes[1])


def test_overlap_by_hand():
    centers, axes, upright = np.zeros((1, 3)), np.ones((1, 3)), np.eye(3)[None]
    cube = Solids.of_axes((Shape.CUBOID,), centers, axes, upright)
    beside = Solids.of_axes((Shape.CUBOID,), centers + [0.5, 0, 0], axes, upright)
    can = Solids.of_axes((Shape.CYLINDER,), centers, axes, upright)
    ball = Solids.of_axes((Shape.ELLIPSOID,), centers, axes, upright)
    assert solid_iou(cube, cube) == pytest.approx(1.0)
    assert solid_iou(cube, beside) == pytest.approx(1.5 / 2.5, abs=2e-3)
    assert solid_iou(cube, can) == pytest.approx(np.pi / 4, abs=2e-3)
    assert solid_iou(ball, can) == pytest.approx(2 / 3, abs=2e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_meshes_are_closed_and_turned_outward(shape):
    solids = solids_of((shape,))
    surface_mesh = mesh(solids, 0)
    corners = surface_mesh.vertices[surface_mesh.triangles]
    signed = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    inscribed = {Shape.ELLIPSOID: 0.98, Shape.CUBOID: 1.0, Shape.CYLINDER: 0.993}[shape]
    assert signed.sum() == pytest.approx(inscribed * solids.volumes[0], rel=5e-3)
    edges = np.vstack(
        [
            surface_mesh.triangles[:, [0, 1]],
            surface_mesh.triangles[:, [1, 2]],
            surface_mesh.triangles[:, [2, 0]],
        ]
    )
    directed, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 1).all()
    assert {tuple(edge) for edge in directed.tolist()} == {
        tuple(e[::-1]) for e in directed.tolist()
    }


def test_wireframes_and_outlines_from_above():
    cube = Solids.of_axes(
        (Shape.CUBOID, Shape.CYLINDER),
        np.array([[1.0, 2, 3]] * 2),
        np.array([[1.0, 2, 0.5]] * 2),
        np.array([np.eye(3)] * 2),
    )
    lines = wireframe(cube, 0)
    lengths = [float(np.linalg.norm(line[1] - line[0])) for line in lines]
    assert sorted(lengths) == [1.0] * 4 + [2.0] * 4 + [4.0] * 4
    above = flat_outline(cube, 0, np.eye(3)[:2])
    np.testing.assert_allclose([*above.min(axis=1), *above.max(axis=1)], [0, 0, 2, 4])
    assert above.shape == (2, 5)
    rims = wireframe(cube, 1)
    assert [len(line) for line in rims] == [49, 49, 2, 2, 2, 2]
    for line, end in zip(rims, (-1, 1), strict=False):
        u = (line - [1, 2, 3]) / [1, 2, 0.5]
        np.testing.assert_allclose(np.hypot(u[:, 0], u[:, 1]), 1.0)
        np.testing.assert_allclose(u[:, 2], end)
