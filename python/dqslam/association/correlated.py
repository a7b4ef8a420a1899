"""Least squares of poses and objects, the errors of an object's boxes correlated.

Dense normal equations: the repeated part of the errors ties all poses that see an object to each
other. That is for some hundred poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.association.repetition import RepeatedNoise, Whitener
from dqslam.subgraph import only_objects

# Boxes are as heavy in the tails as a multivariate Student t of so many degrees of freedom.
TAIL_DOF = 3.0
EDGES = 4
FIRST_DAMPING, MAX_DAMPING = 1e-6, 1e6
# An estimate has converged when a step would lower the cost by less than this share.
SMALL_DECREASE = 1e-4
OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class ObjectBoxes:
    """The boxes of one object, one at each pose at most."""

    rows: Ints
    """Of the problem's boxes, shape (n,)."""
    poses: Ints
    """Shape (n,)."""
    side: Floats
    """Side of the box across each edge, pixels, shape (4, n)."""


@dataclass(frozen=True)
class Linearization:
    """The problem next to a state: normal equations, and what they are made of."""

    state: _core.State
    cost: float
    """Half the sum of squared residuals, in sigmas."""
    hessian: Floats
    """Of poses but the first, k each, then objects, 9 each; shape (u, u)."""
    gradient: Floats
    """Shape (u,)."""
    error: Floats
    """Boxes less projections, pixels; 0 of edges that tell nothing. Shape (b, 4)."""
    jacobian: Floats
    """Of the projections, by pose and object, (b, 4, k + 9)."""
    weight: Floats
    """What the loss leaves of each box, shape (b,)."""
    correlations: list[Floats]
    """Of the boxes of each object."""
    whiteners: list[Whitener]
    """Of the boxes of each object."""


class CorrelatedProblem:
    """A problem whose boxes have errors that repeat from view to view."""

    def __init__(self, graph: _core.Graph) -> None:
        """Take the poses, odometry, boxes and size priors of a problem, and their covariances.

        Covariances of boxes are not used.
        """
        self.graph = graph
        self.k = 3 if graph.pose_model == _core.PoseModel.SE2 else 6
        boxes = graph.boxes
        side = np.tile(boxes.box[:, 2:] - boxes.box[:, :2], (1, 2)).T
        self.objects = []
        for number in range(graph.num_objects):
            rows = np.flatnonzero(boxes.object == number)
            # Of two boxes on one object in an image, the first is the surer one.
            poses, first = np.unique(boxes.pose[rows].astype(np.int64), return_index=True)
            self.objects.append(ObjectBoxes(rows[first], poses, side[:, rows[first]]))
        odometry = graph.odometry
        steps = len(odometry.from_pose)
        covariance = odometry.covariance.reshape(steps, self.k, self.k)
        self.odometry_precision = np.linalg.inv(covariance)
        self.factors = np.ones((graph.num_objects, 2))
        """Of the variances of each object's boxes: of what is new in an image, and what repeats."""

    def part(self, kept: Bools) -> CorrelatedProblem:
        """Return the problem with some of the objects only, a flag for each, (o,)."""
        part = CorrelatedProblem(only_objects(self.graph, kept))
        part.odometry_precision, part.factors = self.odometry_precision, self.factors[kept]
        return part

    def project(self, state: _core.State) -> tuple[Floats, Bools, Floats]:
        """Return errors of boxes (b, 4), whether their objects are in front (b,), Jacobians."""
        graph, boxes = self.graph, self.graph.boxes
        poses, objects = state.poses[boxes.pose], state.landmarks[boxes.object]
        projected, in_front, jacobian = _core.differentiate_boxes(
            graph.pose_model, graph.camera, poses, objects
        )
        error = boxes.box - projected
        hidden = boxes.truncated.copy()
        cut = np.flatnonzero(boxes.truncated.any(axis=1) & in_front)
        if cut.size:
            hidden[cut] |= _core.edges_out_of_sight(
                graph.pose_model, graph.camera, poses[cut], objects[cut]
            )
        # An edge that is out of sight bounds the object from one side only.
        ignored = hidden & (error * OUTWARD < 0.0)
        return np.where(ignored, 0.0, error), in_front, jacobian * ~ignored[:, :, None]

    def odometry_errors(self, poses: Floats) -> tuple[Floats, Floats]:
        """Return how far motions are from those measured (s, k), by moves of the start (s, k, k).

        By moves of the end, the derivative is the identity.
        """
        model, table = self.graph.pose_model, self.graph.odometry
        motion = _core.between(model, poses[table.from_pose], poses[table.to_pose])
        at_start = -_core.adjoint(model, _core.inverse(model, motion))
        return _core.minus(model, motion, table.relative), at_start

    def weights(self, error: Floats, noise: RepeatedNoise) -> Floats:
        """Return what the loss leaves of each box, (b,), by its chi-square."""
        box, factors = self.graph.boxes.box, self.factors[self.graph.boxes.object]
        parts = noise.edge_variances(np.tile(box[:, 2:] - box[:, :2], (1, 2)))
        variance = factors[:, :1] * parts[0] + factors[:, 1:] * parts[1]
        chi2 = np.sum(error**2 / variance, axis=1)
        return np.asarray((TAIL_DOF + EDGES) / (TAIL_DOF + chi2))

    def linearize(
        self, state: _core.State, noise: RepeatedNoise, *, keeps_poses: bool = False
    ) -> Linearization | None:
        """Lay out the normal equations; None if an object is not in front of a camera.

        If poses are to be kept, those of the objects only.
        """
        error, in_front, jacobian = self.project(state)
        if not in_front.all():
            return None
        weight = self.weights(error, noise)
        n, k = self.graph.num_poses, self.k
        u = k * n + 9 * self.graph.num_objects
        hessian, gradient = np.zeros((u, u)), np.zeros(u)
        between_poses = np.zeros((n, n, k, k))
        cost = self._add_odometry(state.poses, between_poses, gradient[: k * n].reshape(n, k))
        cameras = _core.world_from_camera(self.graph.pose_model, self.graph.camera, state.poses)
        correlations, whiteners = [], []
        for number, boxes in enumerate(self.objects):
            rows, poses = boxes.rows, boxes.poses
            towards = state.landmarks[number, :3] - cameras[poses, :3]
            correlation = noise.correlation(towards)
            counts = np.any(jacobian[rows] != 0.0, axis=2).T
            own_noise = noise.times(self.factors[number])
            whitener = Whitener.of(own_noise, correlation, boxes.side, weight[rows], counts)
            correlations.append(correlation)
            whiteners.append(whitener)
            own = slice(k * n + 9 * number, k * n + 9 * number + 9)
            j = jacobian[rows].transpose(1, 0, 2)  # (4, n, k + 9)
            e = error[rows].T
            white = np.einsum("eij,ej->ei", whitener.precision, e)
            cost += 0.5 * float(np.sum(white * e))
            slope = np.einsum("eia,ei->ia", j, white)
            gradient[: k * n].reshape(n, k)[poses] -= slope[:, :k]
            gradient[own] -= slope[:, k:].sum(axis=0)
            by_object = whitener.precision @ j[:, :, k:]
            hessian[own, own] += np.einsum("eia,eib->ab", j[:, :, k:], by_object)
            # What the boxes leave open of an object stays as it is, as uncertain as it is far.
            hessian[own, own] += np.eye(9) / np.median(np.sum(towards**2, axis=1))
            if keeps_poses:
                continue
            cross = np.einsum("eia,eib->iab", j[:, :, :k], by_object)
            at_poses = np.zeros((n, k, 9))
            at_poses[poses] = cross
            hessian[: k * n, own] = at_poses.reshape(k * n, 9)
            hessian[own, : k * n] = hessian[: k * n, own].T
            pairs = j[:, :, None, :k] * whitener.precision[:, :, :, None]  # (4, n, n, k)
            between_poses[poses[:, None], poses] += np.matmul(
                pairs.transpose(1, 2, 3, 0), j[None, :, :, :k].transpose(0, 2, 1, 3)
            )
        hessian[: k * n, : k * n] = between_poses.transpose(0, 2, 1, 3).reshape(k * n, k * n)
        cost += self._add_sizes(state.landmarks, hessian[k * n :, k * n :], gradient[k * n :])
        return Linearization(
            state,
            cost,
            hessian[k:, k:],
            gradient[k:],
            error,
            jacobian,
            weight,
            correlations,
            whiteners,
        )

    def cost(self, state: _core.State, near: Linearization) -> float:
        """Return the cost of a state with weights and covariances of another; infinite if none."""
        error, in_front, _ = self.project(state)
        if not in_front.all():
            return np.inf
        off, _ = self.odometry_errors(state.poses)
        cost = 0.5 * float(np.einsum("si,sij,sj", off, self.odometry_precision, off))
        for boxes, whitener in zip(self.objects, near.whiteners, strict=True):
            e = error[boxes.rows].T
            cost += 0.5 * float(np.einsum("ei,eij,ej", e, whitener.precision, e, optimize=True))
        u = 9 * self.graph.num_objects
        return cost + self._add_sizes(state.landmarks, np.zeros((u, u)), np.zeros(u))

    def box_costs(self, here: Linearization) -> Floats:
        """Return half the sum of squares of each object's boxes, as weighted there, (o,)."""
        costs = []
        for boxes, whitener in zip(self.objects, here.whiteners, strict=True):
            e = here.error[boxes.rows].T
            white = np.einsum("eij,ej->ei", whitener.precision, e)
            costs.append(0.5 * float(np.sum(white * e)))
        return np.array(costs)

    def retract(self, state: _core.State, step: Floats) -> _core.State:
        """Move a state by a step (u,)."""
        n, k = self.graph.num_poses, self.k
        moves = np.concatenate([np.zeros(k), step[: k * (n - 1)]]).reshape(n, k)
        return _core.State(
            _core.plus(self.graph.pose_model, state.poses, moves),
            state.landmarks + step[k * (n - 1) :].reshape(-1, 9),
        )

    def _add_odometry(self, poses: Floats, hessian: Floats, gradient: Floats) -> float:
        """Add the odometry to (n, n, k, k) and (n, k); return its cost."""
        off, at_start = self.odometry_errors(poses)
        table, w = self.graph.odometry, self.odometry_precision
        i, j = table.from_pose, table.to_pose
        weighted = at_start.transpose(0, 2, 1) @ w
        pull = (w @ off[:, :, None])[:, :, 0]
        np.add.at(hessian, (i, i), weighted @ at_start)
        np.add.at(hessian, (i, j), weighted)
        np.add.at(hessian, (j, i), weighted.transpose(0, 2, 1))
        np.add.at(hessian, (j, j), w)
        np.add.at(gradient, i, (at_start.transpose(0, 2, 1) @ pull[:, :, None])[:, :, 0])
        np.add.at(gradient, j, pull)
        return 0.5 * float(np.sum(off * pull))

    def _add_sizes(self, objects: Floats, hessian: Floats, gradient: Floats) -> float:
        """Add the prior of the logarithms of semi-axes; return its cost."""
        prior = self.graph.size_prior
        axes = np.array([_core.axes_from_ellipsoid(row)[1] for row in objects])
        if not (axes > 0.0).all():
            return np.inf  # rounding has flattened an object
        off = (np.sort(np.log(axes))[:, ::-1] - prior.log_mean[:, None]) / prior.log_sigma[:, None]
        j = np.zeros((3 * len(objects), 9 * len(objects)))
        for row, one in enumerate(objects):
            j[3 * row : 3 * row + 3, 9 * row : 9 * row + 9] = (
                _core.log_semi_axes_jacobian(one) / prior.log_sigma[row]
            )
        r = off.ravel()
        hessian += j.T @ j
        gradient += j.T @ r
        return 0.5 * float(r @ r)


def minimize(
    problem: CorrelatedProblem,
    state: _core.State,
    noise: RepeatedNoise,
    *,
    max_iterations: int,
    keeps_poses: bool = False,
) -> Linearization | None:
    """Improve a state by Levenberg-Marquardt; None if it is not defined to begin with."""
    from scipy.linalg import cho_factor, cho_solve

    here = problem.linearize(state, noise, keeps_poses=keeps_poses)
    damping = FIRST_DAMPING
    free = slice(problem.k * (problem.graph.num_poses - 1) if keeps_poses else 0, None)
    for _ in range(max_iterations):
        if here is None:
            return None
        better, expected = None, np.inf
        while better is None and damping < MAX_DAMPING:
            damped = here.hessian[free, free].copy()
            damped[np.diag_indices(len(damped))] *= 1.0 + damping
            step = np.zeros(len(here.gradient))
            try:
                step[free] = -cho_solve(cho_factor(damped), here.gradient[free])
            except np.linalg.LinAlgError:
                damping *= 10.0
                continue
            expected = -0.5 * float(step @ here.gradient)
            if expected < SMALL_DECREASE * here.cost:
                break
            trial = problem.retract(here.state, step)
            if problem.cost(trial, here) < here.cost:
                better, damping = trial, max(damping / 10.0, FIRST_DAMPING)
            else:
                damping *= 10.0
        if better is None:
            break
        here = problem.linearize(better, noise, keeps_poses=keeps_poses)
    return here
