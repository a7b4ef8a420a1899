"""Geometry as Python calls it, against perturbed projections in plain numpy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera, PoseModel, _core
from oracle import se2_matrix, se3_matrix

MODELS = [PoseModel.SE2, PoseModel.SE3]
TANGENT = {PoseModel.SE2: 3, PoseModel.SE3: 6}
# It looks along the x axis of the robot, a little downwards.
MOUNT = [0.2, -0.1, 0.5, *(Rotation.from_euler("ZX", [-90, -95], degrees=True)).as_quat()]
CAMERA = Camera(500.0, 510.0, 321.0, 239.0, 640, 480, robot_from_camera=MOUNT)
COUNT = 30
STEP = 1e-6


def random_poses(model, seed):
    random = np.random.default_rng(seed)
    if model == PoseModel.SE2:
        return random.uniform(-3.0, 3.0, (COUNT, 3))
    turns = Rotation.random(COUNT, random_state=random).as_quat()
    return np.hstack([random.uniform(-3.0, 3.0, (COUNT, 3)), turns])


def world_from_robot(model, pose):
    return se2_matrix(pose) if model == PoseModel.SE2 else se3_matrix(pose)


def motion(tangent):
    """Return the matrix (4, 4) of a tangent (3,) or (6,)."""
    matrix = np.eye(4)
    if len(tangent) == 3:
        tangent = np.array([*tangent[:2], 0.0, 0.0, 0.0, tangent[2]])
    matrix[:3, :3] = Rotation.from_rotvec(tangent[3:]).as_matrix()
    matrix[:3, 3] = tangent[:3]
    return matrix


def box_of(world_from_robot, ellipsoid):
    """Return the box (4,) of log-Cholesky parameters (9,): tangents of the dual conic."""
    lower = np.diag(np.exp(ellipsoid[3:6]))
    lower[[1, 2, 2], [0, 0, 1]] = ellipsoid[6:]
    camera_from_world = np.linalg.inv(world_from_robot @ se3_matrix(CAMERA.robot_from_camera))
    center = camera_from_world[:3, :3] @ ellipsoid[:3] + camera_from_world[:3, 3]
    axes = camera_from_world[:3, :3] @ lower
    k = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    conic = k @ (axes @ axes.T - np.outer(center, center)) @ k.T
    conic /= conic[2, 2]
    half = np.sqrt(conic[:2, 2] ** 2 - np.diag(conic)[:2])
    return np.concatenate([conic[:2, 2] - half, conic[:2, 2] + half])


def ellipsoids_before(model, poses):
    """Return one ellipsoid (9,) in front of the camera of each pose."""
    random = np.random.default_rng(3)
    ellipsoids = random.normal(0.0, 0.2, (COUNT, 9)) + [0, 0, 0, -1, -1, -1, 0, 0, 0]
    for row, pose in enumerate(poses):
        world_from_camera = world_from_robot(model, pose) @ se3_matrix(CAMERA.robot_from_camera)
        place = random.uniform([-2, -2, 3], [2, 2, 8])
        ellipsoids[row, :3] = world_from_camera[:3, :3] @ place + world_from_camera[:3, 3]
    return ellipsoids


@pytest.mark.parametrize("model", MODELS)
def test_jacobians_of_boxes_are_what_perturbations_show(model):
    poses, k = random_poses(model, seed=1), TANGENT[model]
    ellipsoids = ellipsoids_before(model, poses)
    boxes, in_front, jacobians = _core.differentiate_boxes(model, CAMERA, poses, ellipsoids)
    assert in_front.all()
    assert jacobians.shape == (COUNT, 4, k + 9)
    for row, (pose, ellipsoid) in enumerate(zip(poses, ellipsoids, strict=True)):
        here = world_from_robot(model, pose)
        np.testing.assert_allclose(boxes[row], box_of(here, ellipsoid), atol=1e-9)
        for column, way in enumerate(np.eye(k + 9)):
            ahead, back = (
                box_of(here @ motion(step * way[:k]), ellipsoid + step * way[k:])
                for step in (STEP, -STEP)
            )
            expected = (ahead - back) / (2.0 * STEP)
            scale = np.abs(jacobians[row]).max()
            np.testing.assert_allclose(jacobians[row, :, column], expected, atol=1e-6 * scale)


def test_what_is_behind_has_no_jacobian():
    pose = np.zeros((2, 3))
    there = np.array(
        [_core.ellipsoid_from_axes([x, 0, 0.5], [0.3] * 3, [0, 0, 0, 1]) for x in (5, -5)]
    )
    boxes, in_front, jacobians = _core.differentiate_boxes(PoseModel.SE2, CAMERA, pose, there)
    np.testing.assert_array_equal(in_front, [True, False])
    assert np.isfinite(boxes[0]).all()
    assert np.isfinite(jacobians[0]).all()
    assert np.isnan(boxes[1]).all()
    assert np.isnan(jacobians[1]).all()
    assert _core.differentiate_boxes(PoseModel.SE2, CAMERA, pose[:0], there[:0])[2].shape == (
        0,
        4,
        12,
    )


@pytest.mark.parametrize("model", MODELS)
def test_adjoints_carry_small_motions_over(model):
    """Of matrices: A exp(x) = exp(Ad x) A."""
    poses, k = random_poses(model, seed=2), TANGENT[model]
    adjoints = _core.adjoint(model, poses)
    assert adjoints.shape == (COUNT, k, k)
    for pose, adjoint in zip(poses, adjoints, strict=True):
        matrix = world_from_robot(model, pose)
        for axis in range(k):
            after = matrix @ motion(STEP * np.eye(k)[axis])
            before = motion(STEP * adjoint[:, axis]) @ matrix
            np.testing.assert_allclose(after, before, atol=1e-10)


@pytest.mark.parametrize("model", MODELS)
def test_inverses(model):
    poses = random_poses(model, seed=4)
    for pose, inverse in zip(poses, _core.inverse(model, poses), strict=True):
        product = world_from_robot(model, pose) @ world_from_robot(model, inverse)
        np.testing.assert_allclose(product, np.eye(4), atol=1e-13)


def test_edges_that_the_image_does_not_show():
    """Of four spheres on the right: in the image, cut, cut beyond the middle, and out of it."""
    plain = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
    here = np.tile(np.eye(7)[6], (4, 1))
    spheres = np.array(
        [_core.ellipsoid_from_axes([x, 0, 5], [0.4] * 3, [0, 0, 0, 1]) for x in (0, 3, 3.4, 4)]
    )
    found = _core.edges_out_of_sight(PoseModel.SE3, plain, here, spheres)
    expected = [[0, 0, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1], [1, 1, 1, 1]]
    np.testing.assert_array_equal(found, np.array(expected, dtype=bool))


def test_a_wrong_table_is_named():
    one, camera = np.zeros((1, 3)), Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
    tables = [
        one,
        np.zeros((1, 9)),
        np.zeros((1, 4)),
        np.zeros((1, 16)),
        np.zeros((1, 4), dtype=bool),
    ]
    with pytest.raises(ValueError, match=r"covariances row 0: .*not symmetric positive definite"):
        _core.box_chi_squares(PoseModel.SE2, camera, *tables)
    with pytest.raises(ValueError, match=r"ellipsoids has shape \(1, 3\), expected \(1, 9\)"):
        _core.box_chi_squares(PoseModel.SE2, camera, one, one, *tables[2:])
