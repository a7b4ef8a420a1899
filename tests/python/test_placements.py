"""Estimates with rules of where objects are."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.metrics import true_rows
from dqslam.placements.planes import find_planes
from dqslam.placements.table import Objects, place


def test_planes_are_where_most_objects_can_stand():
    heights = np.array([0.0, 0.71, 0.01, 0.69, -0.01, 0.70, 2.0, np.nan])
    first, second = sorted(find_planes(heights, np.full(8, 0.02), True), key=lambda p: p.height)
    assert first.rows.tolist() == [0, 2, 4]
    assert second.rows.tolist() == [1, 3, 5]
    assert (first.height, second.height) == pytest.approx((0.0, 0.70), abs=1e-9)
    # One object is no plane, unless it is told that there is one.
    assert find_planes(heights[6:7], np.full(1, 0.02), True) == []
    (ground,) = find_planes(heights, np.full(8, 0.02), False)
    assert len(ground.rows) == 3


def test_uncertain_objects_count_less():
    (plane,) = find_planes(np.array([0.0, 0.0, 0.3]), np.array([0.1, 0.1, 0.2]), True)
    assert plane.height == pytest.approx(0.3 / 4 / (1 + 1 + 1 / 4))


def objects(class_names, centers, reach):
    count = len(class_names)
    return Objects(
        rows=np.arange(count) + 10,
        class_names=tuple(class_names),
        centers=np.array(centers, dtype=float),
        reach=np.array(reach, dtype=float),
        height_sigmas=np.full(count, 0.01),
    )


def test_each_object_gets_the_one_that_it_stands_on():
    # Two desks of 0.7 m; the cup is on the second one, the bowl has no desk in its class.
    names = ["desk", "desk", "cup"]
    centers = [[0, 0, 0.35], [3, 0, 0.35], [2.2, 0.1, 0.75]]
    rows, planes = place(
        (dq.PlacementRule("on", "cup", "desk"), dq.PlacementRule("on", "desk", "ground")),
        objects(names, centers, [[0.8, 0.35], [0.8, 0.35], [0.05, 0.05]]),
    )
    assert [(row.object, row.other, row.plane) for row in rows] == [
        (12, 11, -1),
        (10, -1, 0),
        (11, -1, 0),
    ]
    assert [plane.height for plane in planes] == [0.0]


TABLE = dq.PlacementRules((dq.PlacementRule("on", None, "plane", 0.005),))


@pytest.fixture(scope="module")
def scenario():
    """Look at objects on a table, from a short arc."""
    scenario = dq.load_scenario("orbit")
    path = scenario.path.model_copy(update={"turns": 0.15, "poses": 20})
    world = scenario.world.model_copy(update={"lift_max_m": 0.0})
    return scenario.model_copy(update={"path": path, "world": world})


def simulated(scenario, seed):
    recording, truth = dq.simulate(scenario, seed=seed)
    return replace(recording, positions=None), truth


def center_error(estimate, truth):
    rows = true_rows(estimate.object_ids, truth)
    return np.linalg.norm(estimate.centers - truth.centers[rows], axis=1).mean()


def test_a_plane_of_unknown_height_helps_and_is_found(scenario):
    errors, planes = [], []
    for seed in range(6):
        recording, truth = simulated(scenario, seed)
        graph = dq.build_graph(recording)
        without, _ = dq.solve(graph)
        placed, estimate, summary, found = dq.solve_with_placements(graph, TABLE)
        assert summary.converged
        errors.append((center_error(without, truth), center_error(estimate, truth)))
        (plane,) = found.planes
        planes.append((plane.height, plane.sigma))  # the table is at 0
        assert set(plane.object_ids) <= set(estimate.object_ids)
        marginals = dq.marginal_covariances(placed, estimate)
        assert marginals.shared[-1] == pytest.approx(plane.sigma)
    before, after = np.mean(errors, axis=0)
    assert after < 0.92 * before
    heights, sigmas = np.array(planes).T
    assert np.sqrt(np.mean((heights / sigmas) ** 2)) < 2.0
    assert sigmas.max() < 0.1


def test_wrong_rules_do_no_harm():
    errors = []
    for seed in range(4):
        recording, truth = simulated(dq.load_scenario("paper"), seed)
        boxes = recording.detections
        wrong = np.unique(boxes.object_id)[:2]  # a fifth of the objects
        renamed = replace(
            boxes,
            class_id=np.isin(boxes.object_id, wrong).astype(int),
            class_names={0: "cube", 1: "other"},
        )
        graph = dq.build_graph(replace(recording, detections=renamed))
        rules = dq.PlacementRules(
            (
                dq.PlacementRule("on", "other", "cube", 0.02),
                dq.PlacementRule("upright", "other", None, 0.02),
            )
        )
        without, _ = dq.solve(graph)
        _, estimate, _, found = dq.solve_with_placements(graph, rules)
        assert len(found.kinds) == 4
        errors.append(
            [
                np.linalg.norm(each.poses[:, :2] - truth.poses[:, :2], axis=1).mean()
                for each in (without, estimate)
            ]
        )
    before, after = np.mean(errors, axis=0)
    assert after < 1.03 * before


def test_up_is_a_direction_of_the_world(scenario):
    recording, _ = simulated(scenario, 0)
    graph = dq.build_graph(recording)
    upside_down = dq.PlacementRules(TABLE.rules, up=(0.0, 0.0, -1.0))
    _, _, _, found = dq.solve_with_placements(graph, TABLE)
    _, _, _, other = dq.solve_with_placements(graph, upside_down)
    # Seen upside down, the lowest points are the tops: more scattered, and at negative heights.
    assert found.planes[0].height > -0.1
    assert all(plane.height < 0.0 for plane in other.planes)


def test_a_class_that_is_not_there_is_named(scenario):
    recording, _ = simulated(scenario, 0)
    rules = dq.PlacementRules((dq.PlacementRule("on", "unicorn", "plane"),))
    with pytest.raises(ValueError, match="no class 'unicorn' in the recording"):
        dq.solve_with_placements(dq.build_graph(recording), rules)
    with pytest.raises(TypeError, match="load_placements"):
        dq.solve_with_placements(dq.build_graph(recording), rules.rules)
