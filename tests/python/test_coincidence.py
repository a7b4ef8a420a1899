"""Objects whose ids are wrong so often that their own boxes contradict them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core

PAPER = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
NOISE = dq.BoxNoise(pixels=1.0, relative=0.0)


@cache
def drive(seed=7):
    recording, truth = dq.simulate(PAPER, seed=seed)
    return replace(recording, positions=None), truth


def switched(recording, victim, other, own):
    """Give a victim two fifths of another object's boxes, and leave it a number of its own."""
    detections = recording.detections
    ids = detections.object_id.copy()
    mine, its = (np.flatnonzero(ids == name) for name in (victim, other))
    ids[its[np.arange(len(its)) % 5 < 2]] = victim
    kept = np.ones(len(ids), dtype=bool)
    kept[mine[own:]] = False
    return replace(recording, detections=replace(detections, object_id=ids).select(kept))


@cache
def solved():
    recording, truth = drive()
    names, counts = np.unique(recording.detections.object_id, return_counts=True)
    other, victim = (int(name) for name in names[np.argsort(-counts)[:2]])
    graph = dq.build_graph(switched(recording, victim, other, own=4), box_noise=NOISE)
    estimate, _ = dq.solve(graph)
    return graph, estimate, truth, victim, other


def test_an_object_at_the_place_of_another_is_contradicted():
    _, estimate, truth, victim, other = solved()
    center = estimate.centers[estimate.object_ids == victim][0]
    place = truth.centers[truth.object_ids == other][0]
    assert np.linalg.norm(center - place) < 0.3
    assert estimate.contradicted == {
        victim: f"it is where object {other} is, which fits its boxes as well"
    }
    assert repr(estimate).endswith(", 1 contradicted)")


def test_its_covariance_has_the_ways_to_all_other_objects():
    graph, estimate, truth, victim, _ = solved()
    marginals = dq.marginal_covariances(graph, estimate)
    plain = dq.marginal_covariances(graph, replace(estimate, contradicted={}))
    row = int(np.flatnonzero(estimate.object_ids == victim)[0])
    ways = [
        np.outer(center - estimate.centers[row], center - estimate.centers[row])
        for i, center in enumerate(estimate.centers)
        if i != row
    ]
    np.testing.assert_allclose(
        marginals.centers[row], plain.centers[row] + np.mean(ways, axis=0), rtol=1e-9
    )
    others = np.arange(len(estimate.object_ids)) != row
    np.testing.assert_array_equal(marginals.objects[others], plain.objects[others])
    miss = truth.centers[truth.object_ids == victim][0] - estimate.centers[row]
    assert miss @ np.linalg.solve(plain.centers[row], miss) > 1e3
    assert miss @ np.linalg.solve(marginals.centers[row], miss) < 20.0


def test_the_only_object_has_no_covariance_if_it_is_contradicted():
    graph, estimate, *_ = solved()
    row = [0]
    alone = replace(
        estimate,
        object_ids=estimate.object_ids[row],
        dual_quadrics=estimate.dual_quadrics[row],
        ellipsoids=estimate.ellipsoids[row],
        contradicted={int(estimate.object_ids[0]): "5 of 8 boxes do not fit"},
    )
    marginals = dq.marginal_covariances(graph, alone)
    assert np.isnan(marginals.centers[0]).all()
    assert np.isfinite(marginals.poses).all()


def test_an_object_most_of_whose_boxes_do_not_fit_is_contradicted():
    recording, _ = drive()
    detections = recording.detections
    names, counts = np.unique(detections.object_id, return_counts=True)
    name = int(names[np.argmax(counts)])
    own = np.flatnonzero(detections.object_id == name)
    wrong = own[np.arange(len(own)) % 5 < 3]  # three of five
    box = detections.box.copy()
    corner = np.random.default_rng(0).uniform(0.0, 300.0, size=(len(wrong), 2))
    box[wrong] = np.hstack([corner, corner + 100.0])
    recording = replace(recording, detections=replace(detections, box=box))
    estimate, _ = dq.solve(dq.build_graph(recording, box_noise=NOISE))
    assert estimate.contradicted == {name: f"{len(wrong)} of {len(own)} boxes do not fit"}


@pytest.mark.parametrize("box_noise", [NOISE, None])
def test_nothing_is_contradicted_where_ids_are_right(box_noise):
    for seed in range(60, 70):
        recording, _ = drive(seed)
        estimate, _ = dq.solve(dq.build_graph(recording, box_noise=box_noise))
        assert estimate.contradicted == {}, seed


def test_results_keep_the_reason(tmp_path):
    _, estimate, _, victim, _ = solved()
    dq.save_estimate(estimate, tmp_path)
    assert dq.load_results(tmp_path).objects.contradicted == dict(estimate.contradicted)
    assert list(estimate.contradicted) == [victim]


def test_a_second_look_finds_the_better_set_of_boxes():
    """With a third of the ids wrong, a solve that begins at the first one's result often wins."""
    scenario = dq.load_scenario("false_30")
    gains = []
    for seed in range(3, 6):
        recording, _ = dq.simulate(scenario, seed=seed)
        graph = dq.build_graph(replace(recording, positions=None), box_noise=NOISE)
        options = dq.SolveOptions()
        first = _core.solve(graph.core, options)
        estimate, summary = dq.solve(graph, options)
        costs = [
            one.final_cost + 0.5 * options.outlier_chi_square * np.sum(~inliers)
            for one, inliers in ((first.summary, first.inliers), (summary, estimate.inliers))
        ]
        gains.append(costs[0] - costs[1])
    assert min(gains) >= 0.0
    assert max(gains) > 10.0


def exchanged(recording, first, second, period, share):
    """Exchange the ids of two objects in the first boxes of each period of their boxes."""
    detections = recording.detections
    ids = detections.object_id.copy()
    for own, other in ((first, second), (second, first)):
        mine = np.flatnonzero(detections.object_id == own)
        ids[mine[np.arange(len(mine)) % period < share * period]] = other
    return replace(recording, detections=replace(detections, object_id=ids))


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_two_objects_whose_ids_may_be_exchanged_are_named(share):
    recording, truth = drive()
    names, counts = np.unique(recording.detections.object_id, return_counts=True)
    first, second = (int(name) for name in names[np.argsort(-counts)[:2]])
    recording = exchanged(recording, first, second, period=20, share=share)
    graph = dq.build_graph(recording, box_noise=NOISE)
    estimate, _ = dq.solve(graph)
    assert set(estimate.contradicted) == {first, second}
    for name, other in ((first, second), (second, first)):
        assert f"of its boxes show object {other}, and" in estimate.contradicted[name]
    # With 40 % they are in their own places, with 60 % in each other's: the boxes look alike.
    row = int(np.flatnonzero(estimate.object_ids == first)[0])
    place = truth.centers[truth.object_ids == (first if share < 0.5 else second)][0]
    assert np.linalg.norm(estimate.centers[row] - place) < 0.3
    way = truth.centers[truth.object_ids == first][0] - truth.centers[truth.object_ids == second][0]
    variance = dq.marginal_covariances(graph, estimate).centers[row]
    assert way @ np.linalg.solve(variance, way) < 30.0


def test_a_fifth_of_the_ids_exchanged_names_nobody():
    recording, _ = drive()
    names, counts = np.unique(recording.detections.object_id, return_counts=True)
    first, second = (int(name) for name in names[np.argsort(-counts)[:2]])
    recording = exchanged(recording, first, second, period=20, share=0.2)
    estimate, _ = dq.solve(dq.build_graph(recording, box_noise=NOISE))
    assert estimate.contradicted == {}
