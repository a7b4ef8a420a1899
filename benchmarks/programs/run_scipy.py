"""Solve with scipy.optimize.least_squares and the residuals of dqslam, by finite differences.

What one writes in an afternoon: trust region, Jacobian by differences along its sparsity, started
where peers start. First the tangent residual, which is defined everywhere, then the box residual
wherever its object is in front, as dqslam does.
"""

import sys
from collections.abc import Callable

import numpy as np

from benchmarks.exchange import Stopwatch, write_answer
from benchmarks.files import load_problem
from benchmarks.problems import NOISE, SIZES
from dqslam import Graph, _core, build_graph
from dqslam._checks import Bools, Floats
from dqslam._core import PoseModel

_START_RADIUS_M = 0.5


def main(problem: str, answer: str) -> None:
    """Read a problem, write the answer."""
    from scipy.optimize import least_squares

    recording, centers = load_problem(problem)
    stopwatch = Stopwatch()
    with stopwatch("build"):
        graph = build_graph(recording, box_noise=NOISE, size_prior=SIZES)
        residuals = Residuals(graph)
        sparsity = residuals.sparsity()
    with stopwatch("start"):
        spheres = np.zeros((len(centers), 6))
        spheres[:, :3] = np.log(_START_RADIUS_M)
        initial = residuals.pack(graph.core.initial_poses, np.hstack([centers, spheres]))
    iterations = 0
    with stopwatch("solve"):
        for use_boxes in (False, True):
            found = least_squares(
                residuals.stage(initial, use_boxes=use_boxes),
                initial,
                jac_sparsity=sparsity,
                x_scale="jac",
                tr_options={"regularize": False},  # regularized, it creeps
            )
            initial = found.x
            iterations += found.njev
    poses, ellipsoids = residuals.unpack(found.x)
    write_answer(
        answer,
        poses,
        np.array([_core.dual_quadric_from_ellipsoid(row) for row in ellipsoids]),
        stopwatch,
        iterations=iterations,
        cost=found.cost,
    )


class Residuals:
    """Odometry, boxes and size priors of a planar graph, in sigmas, in NumPy.

    Parameters are the poses but the first (n - 1, 3), then the ellipsoids (o, 9).
    """

    def __init__(self, graph: Graph) -> None:
        """Take the arrays out of the graph once."""
        core = self._core = graph.core
        self._box_pose, self._box_object = core.boxes.pose, core.boxes.object
        self._boxes, self._sigma_px = core.boxes.box, np.sqrt(core.boxes.covariance[:, ::5])
        covariance = core.odometry.covariance.reshape(-1, 3, 3)
        self._odometry = core.odometry.relative
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        camera = core.camera
        focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
        self._focal = np.tile(focal, 2)
        self._normals = _normals((self._boxes - np.tile(middle, 2)) / self._focal)

    def pack(self, poses: Floats, ellipsoids: Floats) -> Floats:
        """Return the parameters of poses (n, 3) and ellipsoids (o, 9)."""
        return np.concatenate([poses[1:].ravel(), ellipsoids.ravel()])

    def unpack(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return poses (n, 3) and ellipsoids (o, 9)."""
        core = self._core
        split = 3 * (core.num_poses - 1)
        free = parameters[:split].reshape(-1, 3)
        return np.vstack([core.initial_poses[:1], free]), parameters[split:].reshape(-1, 9)

    def stage(self, start: Floats, *, use_boxes: bool) -> Callable[[Floats], Floats]:
        """Return the residuals as a function; depths and kinds are those of the start."""
        poses, ellipsoids = self.unpack(start)
        center, _ = self._in_camera(poses, ellipsoids)
        depth = np.maximum(np.abs(center[:, 2:]), 0.5)
        _, in_front = self._project(poses, ellipsoids)
        in_pixels = in_front & use_boxes

        def residuals(parameters: Floats) -> Floats:
            poses, ellipsoids = self.unpack(parameters)
            predicted, _ = self._project(poses, ellipsoids)
            boxes = predicted - self._boxes
            tangents = self._tangents(poses, ellipsoids) * self._focal / depth
            error = np.where(in_pixels[:, None], boxes, tangents) / self._sigma_px
            parts = [self._odometry_error(poses), error, self._size_error(ellipsoids)]
            return np.concatenate([part.ravel() for part in parts])

        return residuals

    def sparsity(self) -> object:
        """Return which residuals depend on which parameters, a sparse matrix."""
        from scipy.sparse import bmat, coo_matrix, csr_matrix, kron

        core = self._core
        poses, objects = core.num_poses, core.num_objects

        def incidence(columns: np.ndarray, count: int) -> csr_matrix:
            rows = np.arange(len(columns))
            return coo_matrix((np.ones(len(columns)), (rows, columns)), (len(columns), count))

        steps = incidence(core.odometry.from_pose, poses) + incidence(core.odometry.to_pose, poses)
        seen = incidence(self._box_object, objects)
        return bmat(
            [
                [kron(steps.tocsr()[:, 1:], np.ones((3, 3))), None],
                [
                    kron(incidence(self._box_pose, poses).tocsr()[:, 1:], np.ones((4, 3))),
                    kron(seen, np.ones((4, 9))),
                ],
                [None, kron(incidence(np.arange(objects), objects), np.ones((6, 9)))],
            ],
            format="csr",
        )

    def _project(self, poses: Floats, ellipsoids: Floats) -> tuple[Floats, Bools]:
        return _core.project_to_boxes(
            PoseModel.SE2, self._core.camera, poses[self._box_pose], ellipsoids[self._box_object]
        )

    def _in_camera(self, poses: Floats, ellipsoids: Floats) -> tuple[Floats, Floats]:
        """Return centers (b, 3) and shape factors L (b, 3, 3) in the camera of each box."""
        from scipy.spatial.transform import Rotation

        seen_from = _core.world_from_camera(PoseModel.SE2, self._core.camera, poses)
        camera_from_world = Rotation.from_quat(seen_from[:, 3:]).as_matrix().transpose(0, 2, 1)
        turn = camera_from_world[self._box_pose]
        offset = (ellipsoids[:, :3][self._box_object] - seen_from[:, :3][self._box_pose])[..., None]
        return (turn @ offset)[..., 0], turn @ _factors(ellipsoids)[self._box_object]

    def _tangents(self, poses: Floats, ellipsoids: Floats) -> Floats:
        """Return n.p + |L^T n| of the plane behind each edge, meters, (b, 4)."""
        center, factor = self._in_camera(poses, ellipsoids)
        reach = np.linalg.norm(self._normals @ factor, axis=2)
        return np.asarray((self._normals @ center[..., None])[..., 0] + reach)

    def _odometry_error(self, poses: Floats) -> Floats:
        predicted = _core.compose(PoseModel.SE2, poses[:-1], self._odometry)
        error = _core.minus(PoseModel.SE2, predicted, poses[1:])
        return np.asarray((self._whiten @ error[..., None])[..., 0])

    def _size_error(self, ellipsoids: Floats) -> Floats:
        """Return (log(S) / 2 - mean) / sigma as vectors of the same norm, (o, 6)."""
        factors = _factors(ellipsoids)
        values, axes = np.linalg.eigh(factors @ factors.transpose(0, 2, 1))
        log = np.einsum("oik,ok,ojk->oij", axes, 0.5 * np.log(values), axes)
        log -= self._core.size_prior.log_mean[:, None, None] * np.eye(3)
        beside = np.sqrt(2.0) * log[:, [0, 1, 2], [1, 2, 0]]
        own = np.diagonal(log, axis1=1, axis2=2)
        return np.asarray(np.hstack([own, beside]) / self._core.size_prior.log_sigma[:, None])


def _factors(ellipsoids: Floats) -> Floats:
    """Return the Cholesky factors L of the shapes, meters, (o, 3, 3)."""
    factors = np.zeros((len(ellipsoids), 3, 3))
    factors[:, [0, 1, 2], [0, 1, 2]] = np.exp(ellipsoids[:, 3:6])
    factors[:, [1, 2, 2], [0, 0, 1]] = ellipsoids[:, 6:]
    return factors


def _normals(edges: Floats) -> Floats:
    """Return the outward normals (b, 4, 3) of the planes behind edges (b, 4), focal length 1."""
    normals = np.zeros((len(edges), 4, 3))
    for edge, (axis, sign) in enumerate([(0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0)]):
        normals[:, edge, axis] = sign
        normals[:, edge, 2] = -sign * edges[:, edge]
    return normals


if __name__ == "__main__":
    main(*sys.argv[1:])
