"""Relative positions: where an image shows the center of a surface, and how well it knows that."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from depth_scenes import CAMERA, Cuboid, Floor, at, cast, look_at, results_of, ring
from dqslam.io import BoxTable, MapObjects, read_positions

BODY = at(0, 0, 0.2, half=(0.25, 0.2, 0.2), yaw=0.3, kind=Cuboid)
PATH = ring(16, 1.5, 0.9, target=(0.0, 0.0, 0.2))
OPTIONS = dq.SurfaceOptions(voxel=0.012)


def boxes_of(pose, objects):
    """Return boxes, of which only poses and objects matter."""
    count = len(pose)
    return BoxTable(
        pose=np.array(pose),
        box=np.tile([10.0, 10.0, 300.0, 200.0], (count, 1)),
        truncated=np.zeros((count, 4), dtype=bool),
        score=np.ones(count),
        class_id=np.zeros(count, dtype=int),
        class_name=("thing",) * count,
        object_id=np.array(objects),
        inlier=np.ones(count, dtype=bool),
        held_out=np.zeros(count, dtype=bool),
    )


def measured(poses, images, surfaces, pose=None, objects=None):
    results = results_of(poses, [BODY])
    count = len(poses)
    table = boxes_of(range(count) if pose is None else pose, objects or [0] * count)
    object.__setattr__(results, "boxes", table)
    depth = dq.DepthImages.from_arrays(results.timestamps, images)
    return dq.surface.relative_positions(results, depth, surfaces)


@pytest.fixture(scope="module")
def surfaces():
    images = cast(PATH, [BODY, Floor()], sigma=0.002)
    results = results_of(PATH, [BODY])
    depth = dq.DepthImages.from_arrays(results.timestamps, images)
    return dq.fuse_surfaces(results, depth, options=OPTIONS)


def test_centers_are_those_of_the_truth(surfaces):
    images = cast(PATH, [BODY, Floor()], sigma=0.002, seed=1)
    found = measured(PATH, images, surfaces)
    np.testing.assert_array_equal(found.pose, np.arange(16))
    # Each camera looks at the center from the same distance.
    away = np.hypot(1.5, 0.9)
    np.testing.assert_allclose(found.object_in_robot, np.tile([0, 0, away], (16, 1)), atol=0.005)
    off = found.object_in_robot - [0.0, 0.0, away]
    nees = np.einsum("pi,pij,pj->p", off, np.linalg.inv(found.covariance), off)
    # As if each were worth an eighth of itself, so that all sixteen are worth two.
    assert 0.05 < 8.0 * nees.mean() < 3.0


def test_all_positions_of_an_object_are_worth_two(surfaces):
    images = cast(PATH, [BODY, Floor()], sigma=0.002, seed=1)
    two, all_of_them = measured(PATH[:2], images[:2], surfaces), measured(PATH, images, surfaces)
    np.testing.assert_array_equal(two.object_in_robot, all_of_them.object_in_robot[:2])
    np.testing.assert_allclose(8.0 * two.covariance, all_of_them.covariance[:2])


def test_a_camera_that_was_elsewhere_measures_where_it_was(surfaces):
    """The map believes the path; the images were taken up to 3 cm from it."""
    rng = np.random.default_rng(3)
    moved = np.array(PATH)
    shifts = rng.uniform(-0.03, 0.03, (16, 3))
    moved[:, :3] += shifts
    found = measured(PATH, cast(moved, [BODY, Floor()], sigma=0.002), surfaces)
    center = surfaces.surfaces[0].to_world(surfaces.surfaces[0].solid.center)
    turns = Rotation.from_quat(PATH[:, 3:]).as_matrix()
    true = np.einsum("pji,pj->pi", turns, center - moved[:, :3])
    np.testing.assert_allclose(found.object_in_robot, true, atol=0.006)


def test_along_the_only_face_less_is_known(surfaces):
    """A camera before the middle of the face whose normal is the object's x sees only that face."""
    normal = BODY.turn[:, 0]
    pose = look_at(BODY.center + 1.0 * normal, BODY.center)[None]
    found = measured(pose, cast(pose, [BODY]), surfaces)
    across_x, across_y, along = np.sqrt(np.diagonal(found.covariance[0]))
    assert along < 0.008
    assert min(across_x, across_y) > 1.5 * along


def test_what_hides_the_object_is_not_measured(surfaces):
    hides = at(0, 0, 0.7, half=(0.6, 0.6, 0.02), kind=Cuboid)
    above = look_at(np.array([0.05, 0.0, 2.0]), BODY.center)[None]
    assert len(measured(above, cast(above, [BODY, Floor()]), surfaces)) == 1
    assert len(measured(above, cast(above, [BODY, hides, Floor()]), surfaces)) == 0


def test_boxes_without_a_surface_have_no_position(surfaces):
    images = cast(PATH[:2], [BODY, Floor()])
    found = measured(PATH[:2], images, surfaces, pose=[0, 0, 1, 1], objects=[0, 7, -1, 0])
    np.testing.assert_array_equal(found.pose, [0, 1])
    np.testing.assert_array_equal(found.object_id, [0, 0])
    results = results_of(PATH[:2], [BODY])
    depth = dq.DepthImages.from_arrays(results.timestamps, images)
    with pytest.raises(ValueError, match="has no boxes"):
        dq.surface.relative_positions(results, depth, surfaces)


def test_the_file_is_what_run_reads(surfaces, tmp_path):
    images = cast(PATH[:3], [BODY, Floor()])
    found = measured(PATH[:3], images, surfaces)
    dq.surface.write_positions(tmp_path / "positions.csv", results_of(PATH[:3], [BODY]), found)
    again = read_positions(tmp_path / "positions.csv", 0.1 * np.arange(3))
    np.testing.assert_array_equal(again.pose, found.pose)
    np.testing.assert_array_equal(again.object_id, found.object_id)
    np.testing.assert_allclose(again.object_in_robot, found.object_in_robot, rtol=1e-7)
    np.testing.assert_allclose(again.covariance, found.covariance, rtol=1e-6)


def test_positions_make_path_and_centers_better():
    """A camera goes half round two cuboids with poor odometry: boxes alone, and with depth."""
    bodies = [BODY, at(0.5, 0.5, 0.15, half=(0.15, 0.1, 0.15), yaw=1.0, kind=Cuboid)]
    path = ring(16, 1.7, 0.9, target=(0.2, 0.2, 0.2), share=0.6)
    times = 0.1 * np.arange(len(path))
    depth = dq.DepthImages.from_arrays(times, cast(path, [*bodies, Floor()], sigma=0.002))
    before, after = [], []
    for seed in (5, 6, 7):
        recording = recorded(path, bodies, np.random.default_rng(seed))
        graph = dq.build_graph(recording, shapes=dq.Shape.CUBOID)
        estimate, _ = dq.solve(graph)
        before.append(errors_of(graph, estimate, path, bodies))
        for _ in range(2):
            boxes = recording.detections
            results = results_of(estimate.poses, [])
            object.__setattr__(results, "objects", mapped(estimate))
            object.__setattr__(results, "boxes", boxes_of(boxes.pose, boxes.object_id))
            found = dq.fuse_surfaces(results, depth, options=dq.SurfaceOptions(voxel=0.02))
            positions = dq.surface.relative_positions(results, depth, found)
            assert len(positions) >= 28
            with_depth = replace(recording, positions=positions)
            graph = dq.build_graph(with_depth, shapes=dq.Shape.CUBOID)
            estimate, _ = dq.solve(graph)
        after.append(errors_of(graph, estimate, path, bodies))
    paths, centers, _ = np.mean(after, axis=0) / np.mean(before, axis=0)
    assert paths < 0.95
    assert centers < 0.75
    # Three coordinates: 3 is right. If positions were independent, it would be 9.
    assert np.mean(after, axis=0)[2] < 4.5


def recorded(path, bodies, rng):
    """Return odometry with 1 cm and 10 mrad of noise a step, and boxes with 1 px of noise."""
    boxes = [[box_of(one, body) + rng.normal(0.0, 1.0, 4) for body in bodies] for one in path]
    pose, objects = np.divmod(np.arange(len(path) * len(bodies)), len(bodies))
    detections = dq.Detections.from_xyxy(pose, np.concatenate(boxes), object_id=objects)
    odometry = dq.Odometry.from_poses(drifting(path, rng), covariance=1e-4 * np.eye(6))
    return dq.Recording(CAMERA, 0.1 * np.arange(len(path)), odometry, detections)


def box_of(pose, body):
    """Return the exact box of a cuboid."""
    corners = np.array(list(product((-1, 1), repeat=3))) * body.half @ body.turn.T + body.center
    x, y, z = ((corners - pose[:3]) @ Rotation.from_quat(pose[3:]).as_matrix()).T
    u, v = CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy
    return np.array([u.min(), v.min(), u.max(), v.max()])


def drifting(path, rng):
    """Return poses whose steps have 1 cm and 10 mrad of noise."""
    poses = [path[0]]
    for before, after in zip(path[:-1], path[1:], strict=True):
        turn = Rotation.from_quat(before[3:]).inv()
        step = turn.apply(after[:3] - before[:3]) + rng.normal(0.0, 0.01, 3)
        rotation = turn * Rotation.from_quat(after[3:])
        rotation = rotation * Rotation.from_rotvec(rng.normal(0.0, 0.01, 3))
        last = Rotation.from_quat(poses[-1][3:])
        poses.append(
            np.concatenate([poses[-1][:3] + last.apply(step), (last * rotation).as_quat()])
        )
    return np.array(poses)


def mapped(estimate):
    count = len(estimate.object_ids)
    return MapObjects(
        object_ids=estimate.object_ids,
        class_names=estimate.class_names,
        centers=estimate.centers,
        semi_axes=estimate.semi_axes,
        orientations=estimate.orientations,
        dual_quadrics=estimate.dual_quadrics,
        observations=estimate.observations,
        center_covariances=np.full((count, 3, 3), np.nan),
        log_semi_axes_sigmas=np.full((count, 3), np.nan),
    )


def errors_of(graph, estimate, path, bodies):
    """Return mean errors of positions and of centers, meters, and the NEES of centers."""
    off = estimate.centers - [body.center for body in bodies]
    paths = np.linalg.norm(estimate.poses[:, :3] - path[:, :3], axis=1).mean()
    covariance = dq.marginal_covariances(graph, estimate).objects[:, :3, :3]
    nees = np.einsum("oi,oij,oj->o", off, np.linalg.inv(covariance), off)
    return paths, np.linalg.norm(off, axis=1).mean(), nees.mean()
