"""Covariances of an estimate, and their bound.

The first pose is fixed, and everything is relative to it.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints, require
from dqslam._core import LandmarkModel, Loss, Mode, SolveOptions
from dqslam._repr import counted
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.metrics import true_rows
from dqslam.recording import Truth
from dqslam.subgraph import only_objects, rebuilt

# Sigma of a rotation, rad, up to which the spread of a pose is a straight one in exponential
# coordinates: the NEES of the end of a straight drive of 200 m is 1.1 there, 2.0 at twice that.
LARGEST_TURN = 0.1


@dataclass(frozen=True)
class UnderConstrained:
    """A parameter of a pose or an object that neither the data nor the priors determine."""

    kind: Literal["pose", "object"]
    name: int
    """Row of the pose, or id of the object."""
    parameter: int
    """Index of the parameter in the tangent of the pose or the object."""

    def __str__(self) -> str:
        """Describe it in a sentence."""
        return (
            f"{self.kind} {self.name}: parameter {self.parameter} is not determined by the data "
            "and the priors"
        )


@dataclass(frozen=True, eq=False)
class Marginals:
    """Marginal covariances of each pose and object; NaN for one that is under-constrained."""

    poses: Floats
    """Covariances in the frame of each pose, translation [m] before rotation [rad]; (n, k, k)."""
    objects: Floats
    """Covariances of center [m] and log-Cholesky shape, shape (o, 9, 9).

    Those of cuboids and cylinders are of the parameters in `Estimate.landmarks`.
    """
    under_constrained: tuple[UnderConstrained, ...]
    """One entry for each pose and object with an undetermined parameter."""
    shared: Floats = field(default_factory=lambda: np.zeros(0))
    """Standard deviations of `Estimate.shared`, shape (s,)."""

    def __repr__(self) -> str:
        """Show the numbers of poses and objects, and of those that are under-constrained."""
        unknown = f", {len(self.under_constrained)} under-constrained"
        return (
            f"Marginals({counted(len(self.poses), 'pose')}, {counted(len(self.objects), 'object')}"
            f"{unknown if self.under_constrained else ''})"
        )

    @property
    def is_bent(self) -> Bools:
        """Whether no Gaussian describes the error of a pose, shape (n,).

        Its rotation has a sigma of more than 0.1 rad. Across the bow along which such a pose is
        spread, errors are then larger than the covariance says, in `tangent_errors`, too.
        """
        first = 2 if self.poses.shape[1] == 3 else 3
        variance = np.diagonal(self.poses, axis1=1, axis2=2)[:, first:]
        return np.asarray((variance > LARGEST_TURN**2).any(axis=1))

    @property
    def centers(self) -> Floats:
        """Covariances of the objects' centers in the world, m^2, shape (o, 3, 3)."""
        return self.objects[:, :3, :3]


@dataclass(frozen=True, eq=False)
class Bound:
    """The posterior Cramer-Rao bound, which no unbiased estimator can beat on average."""

    covariance: Marginals
    """The covariances at the truth."""
    position_error: float
    """Expected mean distance of the poses from their true places (RMSE_pos), meters."""


def marginal_covariances(
    graph: Graph, estimate: Estimate, options: SolveOptions | None = None
) -> Marginals:
    """Return the covariances of an estimate's poses and mapped objects.

    The options are those of the solve. With a robust loss, boxes that do not fit are left out.
    An object in `Estimate.contradicted` may be at the place of any other: the mean of the outer
    products of the ways there is added to the covariance of its center, NaN if there is no other.
    """
    call = "marginal_covariances"
    require(graph, Graph, call, "marginal_covariances(graph, estimate)")
    require(estimate, Estimate, call, "estimate, summary = solve(graph)")
    options = SolveOptions() if options is None else options
    is_quadric = options.landmark_model == LandmarkModel.DUAL_QUADRIC
    landmarks = estimate.dual_quadrics if is_quadric else estimate.ellipsoids
    if estimate.is_body.any():
        landmarks = estimate.landmarks
    mapped = np.isin(graph.object_ids, estimate.object_ids)
    core = graph.core if mapped.all() else only_objects(graph.core, mapped)
    shapes = list(estimate.object_shapes)
    state = _core.State(estimate.poses, landmarks, shapes, estimate.shared)
    found = _marginals(core, estimate.object_ids, options, state)
    return replace(found, objects=with_contradictions(found.objects, estimate))


def with_contradictions(objects: Floats, estimate: Estimate) -> Floats:
    """Return covariances of objects, (o, 9, 9), that are wider for those that are contradicted."""
    rows = np.flatnonzero(np.isin(estimate.object_ids, list(estimate.contradicted)))
    wider = objects.copy()
    for row in rows:
        ways = np.delete(estimate.centers, row, axis=0) - estimate.centers[row]
        wider[row, :3, :3] += ways.T @ ways / len(ways) if len(ways) else np.nan
    return wider


def posterior_bound(graph: Graph, truth: Truth) -> Bound:
    """Return the bound for a problem, from its covariances at the truth.

    Objects that are not ellipsoids have no true parameters, so the result of mapping at the true
    poses replaces them. Ids are assumed to be right.
    """
    require(graph, Graph, "posterior_bound", "call build_graph(recording) first")
    require(truth, Truth, "posterior_bound", "recording, truth = simulate(scenario, seed=0)")
    options = SolveOptions(loss=Loss.NONE)
    state = true_state(graph, truth, options)
    covariance = _marginals(graph.core, graph.object_ids, options, state)
    axes = 2 if graph.core.pose_model == _core.PoseModel.SE2 else 3
    error = expected_distance(covariance.poses[:, :axes, :axes]).mean()
    return Bound(covariance, float(error))


def true_state(graph: Graph, truth: Truth, options: SolveOptions) -> _core.State:
    """Return the true poses and objects of a problem.

    Objects that are not ellipsoids, or that do not exist, are mapped at the true poses. All have
    the parameters of the ellipsoid model.
    """
    exists = np.isin(graph.object_ids, truth.object_ids)
    if truth.ellipsoids is not None and exists.all():
        return _core.State(truth.poses, truth.ellipsoids[true_rows(graph.object_ids, truth)])
    at_truth = rebuilt(graph.core, initial_poses=truth.poses)
    mapping = SolveOptions(mode=Mode.MAPPING, loss=options.loss)
    mapped = _core.solve(at_truth, mapping)
    objects = np.array(mapped.landmarks)
    if truth.ellipsoids is not None:
        objects[exists] = truth.ellipsoids[true_rows(graph.object_ids[exists], truth)]
    return _core.State(truth.poses, objects, mapped.shapes)


def expected_distance(covariances: Floats) -> Floats:
    """Return the mean length of zero-mean Gaussian vectors of covariance (n, k, k), k up to 3.

    With eigenvalues l it is 2 sqrt(2 / pi) R_G(l1, l2, l3). Carlson's R_G is the mean of the
    spread over directions, and the factor is the mean of chi with three degrees of freedom.
    """
    from scipy.special import elliprg

    size = covariances.shape[-1]
    variances = np.zeros((len(covariances), 3))
    known = np.isfinite(covariances).all(axis=(1, 2))
    variances[known, :size] = np.linalg.eigvalsh(covariances[known]).clip(min=0.0)
    variances[~known] = np.nan
    return np.asarray(2.0 * np.sqrt(2.0 / np.pi) * elliprg(*variances.T))


def normalized_squares(errors: Floats, covariances: Floats) -> Floats:
    """Return the squared errors (n, k) in sigmas of covariances (n, k, k), divided by k; (n,)."""
    whitened = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    return np.asarray((errors * whitened).mean(axis=1))


def tangent_errors(model: _core.PoseModel, true: Floats, estimated: Floats) -> Floats:
    """Return the errors of poses in exponential coordinates, for true and estimated (n, d).

    They are the logarithm of estimated^-1 true in SE(2) or SE(3), translation [m] before rotation
    [rad], in the frame of each estimated pose: shape (n, k). A pose at the end of a path without
    loops is spread along a bow, since every error of its rotation has turned the rest of the path.
    In these coordinates the bow is nearly straight, so that the covariance of the pose, which is
    the same to first order, describes it.
    """
    split = _core.minus(model, true, estimated)
    if model == _core.PoseModel.SE2:
        rotation = np.pad(split[:, 2:], ((0, 0), (2, 0)))
        translation = np.pad(split[:, :2], ((0, 0), (0, 1)))
    else:
        translation, rotation = split[:, :3], split[:, 3:]
    # V^-1 t = t - w x t / 2 + (1 - (a / 2) cot(a / 2)) / a^2 w x (w x t), with a = |w|
    angle = np.linalg.norm(rotation, axis=1)[:, None]
    half = 0.5 * np.maximum(angle, 1e-4)
    factor = np.where(angle < 1e-4, 1.0 / 12.0, (1.0 - half / np.tan(half)) / (4.0 * half**2))
    once = np.cross(rotation, translation)
    straight = translation - 0.5 * once + factor * np.cross(rotation, once)
    size = split.shape[1] // 2 + split.shape[1] % 2
    return np.hstack([straight[:, :size], split[:, size:]])


def chi_square_interval(freedom: int) -> list[float]:
    """Return the interval of 95 % of chi-squares, divided by their degrees of freedom."""
    from scipy.stats import chi2

    return [float(chi2.ppf(share, freedom) / freedom) for share in (0.025, 0.975)]


def _marginals(
    core: _core.Graph, object_ids: Ints, options: SolveOptions, state: _core.State
) -> Marginals:
    found = _core.covariance(core, options, state)
    size = round(found.poses.shape[1] ** 0.5)
    return Marginals(
        poses=found.poses.reshape(-1, size, size),
        objects=found.objects.reshape(-1, 9, 9),
        under_constrained=tuple(_named(each, object_ids) for each in found.under_constrained),
        shared=np.sqrt(found.shared),
    )


def _named(found: _core.UnderConstrained, object_ids: Ints) -> UnderConstrained:
    if found.kind == _core.VariableKind.POSE:
        return UnderConstrained("pose", found.row, found.parameter)
    return UnderConstrained("object", int(object_ids[found.row]), found.parameter)
