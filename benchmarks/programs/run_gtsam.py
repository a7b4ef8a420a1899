"""Solve with gtsam_quadrics, Levenberg-Marquardt with its defaults, as its own examples do.

Runs in an interpreter of its own (Python 3.10, NumPy 1): nothing of dqslam is imported here.

Poses are gtsam.Pose3 of the camera. Odometry is planar: what leaves the plane has a sigma of
1 mm and 1 mrad a step. Quadrics start at `start_centers` as spheres of 0.5 m.
"""

import sys
from typing import Any

import gtsam
import gtsam_quadrics
import numpy as np
from numpy.typing import NDArray

from benchmarks.exchange import Stopwatch, write_answer

Floats = NDArray[np.float64]
Given = dict[str, NDArray[Any]]  # the arrays of files.save_problem

_START_RADIUS_M = 0.5
_OFF_PLANE_SIGMA = 1e-3  # meters and radians
_FIRST_POSE_SIGMA = 1e-4  # meters and radians: the gauge


def main(problem: str, answer: str) -> None:
    """Read a problem, write the answer."""
    with np.load(problem) as arrays:
        given = dict(arrays)
    stopwatch = Stopwatch()
    with stopwatch("build"):
        graph = build(given)
    with stopwatch("start"):
        values = start(given)
    with stopwatch("solve"):
        optimizer = gtsam.LevenbergMarquardtOptimizer(
            graph, values, gtsam.LevenbergMarquardtParams()
        )
        found = optimizer.optimize()
    poses = [found.atPose3(pose_key(row)) for row in range(len(given["camera_poses"]))]
    quadrics = [
        gtsam_quadrics.ConstrainedDualQuadric.getFromValues(found, object_key(row)).matrix()
        for row in range(len(given["start_centers"]))
    ]
    write_answer(
        answer,
        robot_poses(np.array([pose.matrix() for pose in poses]), given["camera_in_robot"]),
        upper_triangles(np.array(quadrics)),
        stopwatch,
        iterations=optimizer.iterations(),
        cost=optimizer.error(),
    )


def pose_key(row: int) -> int:
    """Return the key of a pose."""
    return int(gtsam.symbol("x", int(row)))


def object_key(row: int) -> int:
    """Return the key of an object."""
    return int(gtsam.symbol("q", int(row)))


def build(given: Given) -> Any:
    """Add the gauge, a factor for each step of odometry, and one for each box."""
    graph = gtsam.NonlinearFactorGraph()
    gauge = gtsam.noiseModel.Diagonal.Sigmas(np.full(6, _FIRST_POSE_SIGMA))
    graph.add(gtsam.PriorFactorPose3(pose_key(0), gtsam.Pose3(given["camera_poses"][0]), gauge))
    covariances = in_camera(given["covariance"], given["camera_in_robot"][:3, :3])
    for row, (step, covariance) in enumerate(zip(given["camera_steps"], covariances, strict=True)):
        noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
        graph.add(
            gtsam.BetweenFactorPose3(pose_key(row), pose_key(row + 1), gtsam.Pose3(step), noise)
        )
    fx, fy, cx, cy = given["intrinsics"]
    camera = gtsam.Cal3_S2(fx, fy, 0.0, cx, cy)
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.full(4, float(given["box_sigma_px"])))
    rows = zip(given["box"].tolist(), given["pose"], given["object_row"], strict=True)
    for box, pose, row in rows:
        graph.add(
            gtsam_quadrics.BoundingBoxFactor(
                gtsam_quadrics.AlignedBox2(*box), camera, pose_key(pose), object_key(row), noise
            )
        )
    return graph


def in_camera(covariance: Floats, robot_from_camera: Floats) -> Floats:
    """Turn planar covariances (n, 3, 3) of x, y, heading into those of gtsam (n, 6, 6).

    Gtsam's tangents have rotation first; theirs is the camera's frame. The arm from the robot's
    origin to the camera is along the heading's axis: the heading's error moves no camera.
    """
    planar = np.zeros((len(covariance), 6, 6))  # rotation, then translation, in the robot's frame
    planar[:] = np.diag(np.full(6, _OFF_PLANE_SIGMA**2))
    axes = [3, 4, 2]
    planar[np.ix_(range(len(covariance)), axes, axes)] = covariance
    turn = np.kron(np.eye(2), robot_from_camera)
    return turn.T @ planar @ turn


def start(given: Given) -> Any:
    """Start poses where odometry says, objects at their given centers."""
    values = gtsam.Values()
    for row, pose in enumerate(given["camera_poses"]):
        values.insert(pose_key(row), gtsam.Pose3(pose))
    for row, center in enumerate(given["start_centers"]):
        quadric = gtsam_quadrics.ConstrainedDualQuadric(
            gtsam.Rot3(), gtsam.Point3(*center), np.full(3, _START_RADIUS_M)
        )
        quadric.addToValues(values, object_key(row))
    return values


def robot_poses(world_from_camera: Floats, robot_from_camera: Floats) -> Floats:
    """Return SE(3) poses of the robot, shape (n, 7), from matrices of the camera (n, 4, 4)."""
    matrices = world_from_camera @ np.linalg.inv(robot_from_camera)
    turns = [gtsam.Rot3(matrix[:3, :3]).quaternion() for matrix in matrices]  # w x y z
    return np.column_stack([matrices[:, :3, 3], np.roll(turns, -1, axis=1)])


def upper_triangles(dual_quadrics: Floats) -> Floats:
    """Return q1 .. q9 of dual quadrics (o, 4, 4), scaled so that the last entry is 1."""
    rows, columns = np.triu_indices(4)
    scaled = dual_quadrics / dual_quadrics[:, 3:, 3:]
    return scaled[:, rows, columns][:, :9]


if __name__ == "__main__":
    main(*sys.argv[1:])
