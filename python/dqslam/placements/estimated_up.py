"""The direction up in an estimate with placements, and what its uncertainty adds to covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import SolveOptions
from dqslam.assumptions import GROUND, PLANE, PlacementRule
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.placements.up import Supported, UpDirection, estimate_up
from dqslam.subgraph import only_objects, rebuilt
from dqslam.uncertainty import Marginals, marginal_covariances


def with_up(graph: Graph, up: Floats) -> Graph:
    """Return the problem with another direction up, (3,)."""
    return replace(graph, core=_turned(graph.core, up))


def state_of(estimate: Estimate) -> _core.State:
    """Return the estimate as the state of a problem of its objects."""
    landmarks = estimate.landmarks if estimate.is_body.any() else estimate.ellipsoids
    return _core.State(estimate.poses, landmarks, list(estimate.object_shapes), estimate.shared)


def up_of(
    graph: Graph,
    estimate: Estimate,
    rules: Sequence[PlacementRule],
    sigma: float,
    options: SolveOptions,
) -> UpDirection:
    """Return the direction up at which objects of an estimate without rules stand on planes.

    ``sigma`` is that of the direction of the problem, radians.
    """
    marginals = marginal_covariances(graph, estimate, options)
    known = np.flatnonzero(np.isfinite(marginals.objects).all(axis=(1, 2)))
    prior = UpDirection.with_sigma(graph.core.scene_priors.up, sigma)
    names = np.array(estimate.class_names, dtype=object)
    supported = [
        Supported(
            known if rule.class_name is None else known[names[known] == rule.class_name],
            rule.sigma,
            rule.other == PLANE,
        )
        for rule in rules
        if rule.kind == "on" and rule.other in (PLANE, GROUND)
    ]
    if not supported or not known.size:
        return prior
    joint = _core.joint_covariance(
        mapped_part(graph, estimate), options, state_of(estimate), [], known.tolist()
    )
    count = len(estimate.object_ids)
    covariance, nine = np.zeros((count, 9, count, 9)), np.arange(9)
    covariance[np.ix_(known, nine, known, nine)] = joint.reshape(len(known), 9, -1, 9)
    for row in known.tolist():  # wider than its block where an object is contradicted
        covariance[row, :, row] = marginals.objects[row]
    return estimate_up(estimate, covariance.reshape(9 * count, 9 * count), supported, prior)


def with_uncertain_up(
    graph: Graph, estimate: Estimate, up: UpDirection, options: SolveOptions
) -> Marginals:
    """Return covariances that allow for the uncertainty of the direction up.

    The problem is solved with up turned by a standard deviation about each of its axes. The outer
    products of what moves are added to the covariances at the direction itself.
    """
    marginals = marginal_covariances(graph, estimate, options)
    core = mapped_part(graph, estimate)
    state = state_of(estimate)
    here = _core.solve(core, options, state)
    poses, objects = marginals.poses.copy(), marginals.objects.copy()
    shared = marginals.shared**2
    for direction in up.one_sigma_away():
        there = _core.solve(_turned(core, direction), options, state)
        moved = _core.minus(estimate.pose_model, there.poses, here.poses)
        change = there.landmarks - here.landmarks
        poses += moved[:, :, None] * moved[:, None, :]
        objects += change[:, :, None] * change[:, None, :]
        shared += (there.shared - here.shared) ** 2
    return replace(marginals, poses=poses, objects=objects, shared=np.sqrt(shared))


def mapped_part(graph: Graph, estimate: Estimate) -> _core.Graph:
    """Return the problem of the objects that are in the estimate."""
    return only_objects(graph.core, np.isin(graph.object_ids, estimate.object_ids))


def _turned(core: _core.Graph, up: Floats) -> _core.Graph:
    scene = core.scene_priors
    turned = _core.ScenePriors(
        up=up,
        plane_offset=scene.plane_offset,
        upright_sigma=scene.upright_sigma,
        support_sigma=scene.support_sigma,
        camera_height=scene.camera_height,
        camera_height_sigma=scene.camera_height_sigma,
    )
    return rebuilt(core, scene_priors=turned)
