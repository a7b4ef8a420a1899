from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dqslam import (
    BoxNoise,
    Loss,
    PoseModel,
    SizePrior,
    SolveOptions,
    _core,
    build_graph,
    load_scenario,
    marginal_covariances,
    posterior_bound,
    simulate,
    solve,
)
from dqslam.uncertainty import (
    chi_square_interval,
    expected_distance,
    normalized_squares,
    true_state,
)

PAPER = load_scenario("paper")
HONEST = load_scenario("honest")


@cache
def solved(objects="ellipsoids", seed=6):
    scenario = PAPER.model_copy(update={"objects": objects})
    recording, truth = simulate(scenario, seed=seed)
    recording = replace(recording, positions=None)
    noise = BoxNoise(1.0, 0.0) if objects == "ellipsoids" else BoxNoise()
    graph = build_graph(recording, box_noise=noise)
    return recording, truth, graph, solve(graph)[0]


@pytest.mark.parametrize("size", [2, 3])
def test_expected_distance_is_what_sampling_finds(size):
    random = np.random.default_rng(3)
    root = random.normal(size=(4, size, size))
    covariances = root @ root.transpose(0, 2, 1)
    covariances[3] = 0.0
    samples = random.normal(size=(200000, size))
    sampled = [np.linalg.norm(samples @ one.T, axis=1).mean() for one in root[:3]]
    found = expected_distance(covariances)
    np.testing.assert_allclose(found[:3], sampled, rtol=0.01)
    assert found[3] == 0.0
    round_one = expected_distance(4.0 * np.eye(size)[None])
    np.testing.assert_allclose(round_one, 2.0 * np.sqrt([np.pi / 2.0, 8.0 / np.pi][size - 2]))


def test_the_distance_of_what_is_not_known_is_not():
    assert np.isnan(expected_distance(np.full((1, 2, 2), np.nan)))


def test_the_first_pose_is_certain_and_the_others_grow_with_the_path():
    _, _, graph, estimate = solved()
    marginals = marginal_covariances(graph, estimate)
    assert marginals.poses.shape == (253, 3, 3)
    assert marginals.objects.shape == (len(estimate.object_ids), 9, 9)
    assert marginals.under_constrained == ()
    np.testing.assert_array_equal(marginals.poses[0], 0.0)
    np.testing.assert_allclose(marginals.poses, marginals.poses.transpose(0, 2, 1), atol=1e-15)
    assert np.linalg.eigvalsh(marginals.poses[1:]).min() > 0.0
    assert np.linalg.eigvalsh(marginals.centers).min() > 0.0
    sigma = np.sqrt(np.trace(marginals.poses[:, :2, :2], axis1=1, axis2=2))
    assert 0.01 < sigma[1] < 0.03  # one step of odometry: 0.02 m along, 0.005 m across
    assert sigma[100] > 1.5 * sigma[1]


def test_variances_scale_with_the_noise():
    """All sigmas doubled, at the same state: all variances fourfold. Tells sigma from variance."""
    recording, truth, _, _ = solved()
    positions = []
    for factor in (1.0, 2.0):
        odometry = recording.odometry
        louder = replace(odometry, covariance=factor**2 * odometry.covariance)
        graph = build_graph(
            replace(recording, odometry=louder),
            box_noise=BoxNoise(factor, 0.0),
            size_prior=SizePrior(log_sigma=0.7 * factor),
        )
        positions.append(posterior_bound(graph, truth).covariance.poses[1:])
    np.testing.assert_allclose(positions[1], 4.0 * positions[0], rtol=1e-6)


def test_the_bound_is_the_mean_of_the_expected_distances():
    _, truth, graph, estimate = solved()
    bound = posterior_bound(graph, truth)
    expected = expected_distance(bound.covariance.poses[:, :2, :2])
    assert bound.position_error == pytest.approx(expected.mean())
    at_estimate = marginal_covariances(graph, estimate)
    assert expected_distance(at_estimate.poses[:, :2, :2]).mean() == pytest.approx(
        bound.position_error, rel=0.3
    )


def test_cubes_are_mapped_at_the_true_poses():
    _, truth, graph, _ = solved("cubes")
    state = true_state(graph, truth, SolveOptions())
    np.testing.assert_array_equal(state.poses, truth.poses)
    rows = np.searchsorted(truth.object_ids, graph.object_ids)
    error = np.linalg.norm(state.landmarks[:, :3] - truth.centers[rows], axis=1)
    assert np.median(error) < 0.05
    assert 0.01 < posterior_bound(graph, truth).position_error < 0.5


def test_dropped_objects_take_no_part():
    """The covariance of the rest is that of a problem without the dropped object's boxes."""
    recording, _, _, _ = solved()
    detections = recording.detections
    last = np.flatnonzero(detections.object_id == detections.object_id.max())
    kept = np.ones(len(detections), dtype=bool)
    kept[last[2:]] = False
    box = detections.box.copy()
    box[np.flatnonzero(detections.object_id == detections.object_id.min())[::5]] += 150.0  # wrong
    part = replace(recording, detections=replace(detections, box=box).select(kept))
    options = SolveOptions(loss=Loss.CAUCHY)
    graph = build_graph(part)
    estimate, _ = solve(graph, options)
    assert list(estimate.dropped) == [detections.object_id.max()]
    marginals = marginal_covariances(graph, estimate, options)
    assert len(marginals.objects) == len(graph.object_ids) - 1

    kept[last] = False
    without = replace(recording, detections=replace(detections, box=box).select(kept))
    alone = build_graph(without)
    expected = _core.covariance(
        alone.core, options, _core.State(estimate.poses, estimate.ellipsoids)
    )
    np.testing.assert_allclose(marginals.poses.reshape(-1, 9), expected.poses, rtol=1e-9)


def test_what_is_under_constrained_is_named_by_its_id():
    recording, truth, _, _ = solved()
    detections = recording.detections
    name = int(detections.object_id.max())
    once = detections.object_id != name
    once[np.flatnonzero(~once)[0]] = True
    part = replace(recording, detections=detections.select(once))
    graph = build_graph(part, size_prior=SizePrior(log_sigma=1e3))
    bound = posterior_bound(graph, truth)
    assert bound.covariance.under_constrained
    assert {(one.kind, one.name) for one in bound.covariance.under_constrained} == {
        ("object", name)
    }
    assert str(bound.covariance.under_constrained[0]).startswith(f"object {name}: parameter ")
    row = np.searchsorted(graph.object_ids, name)
    assert np.isnan(bound.covariance.objects[row]).all()
    assert np.isfinite(bound.covariance.objects[:row]).all()
    assert np.isfinite(bound.position_error)


def test_squares_are_in_sigmas_and_by_degrees_of_freedom():
    errors = np.array([[3.0, 0.0, 4.0], [0.0, 1.0, 1.0]])
    covariances = np.array([np.diag([9.0, 1.0, 4.0]), np.eye(3) + 1.0])
    # The second: the inverse of I + 1 1^T is I - 1 1^T / 4, hence 2 - 4 / 4.
    np.testing.assert_allclose(
        normalized_squares(errors, covariances), [(1.0 + 4.0) / 3.0, 1.0 / 3.0]
    )


@cache
def mean_nees(drives=60):
    """Of the last pose and of all centers, over short drives of a world that is as believed."""
    path = HONEST.path.model_copy(update={"length_m": 10.0, "width_m": 7.0, "laps": 1})
    world = HONEST.world.model_copy(update={"object_count": 6})
    scenario = HONEST.model_copy(update={"path": path, "world": world})
    size = scenario.world.log_normal_size
    prior = SizePrior(np.log(size.median_m), np.log(size.spread))
    pose_nees, center_nees = [], []
    for seed in range(drives):
        recording, truth = simulate(scenario, seed=seed)
        boxes_only = replace(recording, positions=None)
        graph = build_graph(boxes_only, box_noise=BoxNoise(1.0, 0.0), size_prior=prior)
        estimate, _ = solve(graph)
        marginals = marginal_covariances(graph, estimate)
        error = _core.minus(PoseModel.SE2, truth.poses[-1:], estimate.poses[-1:])
        pose_nees.append(normalized_squares(error, marginals.poses[-1:]).mean())
        rows = np.searchsorted(truth.object_ids, estimate.object_ids)
        miss = estimate.centers - truth.centers[rows]
        center_nees.append(normalized_squares(miss, marginals.centers).mean())
    return np.mean(pose_nees), np.mean(center_nees), chi_square_interval(3 * drives)


@pytest.mark.parametrize("factor", [1.0, 2.0, 0.5])
def test_errors_are_as_large_as_their_covariances_say(factor):
    """And would be larger or smaller with covariances that are wrong by a factor of two.

    60 squared errors in sigmas, of 3 degrees of freedom: 95 % of their means are in 0.80 .. 1.22.
    """
    pose_nees, center_nees, (low, high) = mean_nees()
    assert (low < pose_nees / factor < high) == (factor == 1.0)
    assert (low < center_nees / factor < high) == (factor == 1.0)
