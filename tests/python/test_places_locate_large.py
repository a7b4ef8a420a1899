"""The search in maps of many objects leaves out no pair that agrees, and is bounded."""

import numpy as np
import pytest
from benchmarks.places import rooms
from scipy.spatial import cKDTree

import dqslam as dq
from dqslam.places.location import quick_score
from dqslam.places.location.hypotheses import Hypotheses
from dqslam.places.location.pairs import (
    _MOST_COMPARED,
    AGREE,
    AGREE_LARGE,
    Pairings,
    _agrees,
    _reaches,
    agreeing_pairs,
    closed,
    triangles,
    triples_by_boxes,
    within_budget,
)
from dqslam.places.location.place_map import REACH


def strewn(random, boxes, objects, extent):
    """Return pairings of each box with each object of a square."""
    center = np.column_stack(
        [random.uniform(0.0, extent, (objects, 2)), random.uniform(0.0, 1.0, objects)]
    )
    direction = np.column_stack([random.uniform(-0.6, 0.6, (boxes, 2)), np.ones(boxes)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    box, row = (part.ravel() for part in np.mgrid[:boxes, :objects])
    usual = np.log(random.uniform(2.0, 7.0, boxes))
    return Pairings(
        box=box,
        object_row=row,
        ray=direction[box],
        log_distance=usual[box] + random.normal(0.0, 0.2, objects)[row],
        sigma=np.full(len(box), 0.15),
        ray_sigma=np.full(len(box), 0.05),
        log_odds=np.zeros(len(box)),
        center=center[row],
    )


@pytest.mark.parametrize("agree", [AGREE, AGREE_LARGE])
@pytest.mark.parametrize("seed", range(3))
def test_no_pair_that_agrees_is_beyond_the_reach(seed, agree):
    pairings = strewn(np.random.default_rng(seed), boxes=5, objects=60, extent=15.0)
    boxes = np.arange(5)
    found = agreeing_pairs(pairings, boxes, _reaches(pairings, boxes, agree), agree)
    i, j = np.triu_indices(len(pairings), 1)
    other = pairings.box[i] != pairings.box[j]
    i, j = i[other], j[other]
    distance = np.linalg.norm(pairings.center[i] - pairings.center[j], axis=1)
    expected = np.column_stack([i, j])[_agrees(pairings, i, j, distance, agree)]
    assert len(expected) > 100
    assert set(map(tuple, found.tolist())) == set(map(tuple, expected.tolist()))


def test_boxes_are_left_out_until_few_enough_pairs_are_compared():
    pairings = strewn(np.random.default_rng(1), boxes=10, objects=3000, extent=150.0)
    boxes, reach = within_budget(pairings, np.arange(10), AGREE)
    assert 3 <= len(boxes) < 10
    trees = [cKDTree(pairings.center[pairings.box == one]) for one in boxes.tolist()]
    pairs = [
        trees[a].count_neighbors(trees[b], reach[a, b])
        for a in range(len(boxes))
        for b in range(a + 1, len(boxes))
    ]
    # At the border of the square there are fewer.
    assert len(boxes) == 3 or 0.4 * _MOST_COMPARED < sum(pairs) < _MOST_COMPARED
    few = strewn(np.random.default_rng(1), boxes=10, objects=30, extent=15.0)
    assert len(within_budget(few, np.arange(10), AGREE)[0]) == 10


def test_boxes_of_far_too_many_objects_are_not_compared_at_all():
    """Ten thousand alike, one on a square meter: three boxes have millions of pairs."""
    pairings = strewn(np.random.default_rng(1), boxes=4, objects=10_000, extent=100.0)
    boxes, reach = within_budget(pairings, np.arange(4), AGREE)
    assert (boxes.shape, reach.shape) == ((0,), (0, 0))


def test_a_map_of_far_too_many_alike_is_ambiguous():
    random = np.random.default_rng(0)
    room = rooms.furnish(100.0, np.full((1, 3), 0.15), np.zeros(10_000, dtype=int), random)
    place = dq.PlaceMap.of(rooms.map_room(room, 10, random, everything=True))
    poses = rooms.draw_poses(room, 1, random)
    boxes = rooms.detections_of(room, rooms.draw_boxes(room, poses, random))
    found = dq.locate(place, boxes, rooms.CAMERA)
    assert found.candidates == ()
    assert found.reason.startswith(f"ambiguous: {len(boxes)} of {len(boxes)} boxes are of classes")
    assert "too many objects among the 10000 of the map" in found.reason


def test_no_box_has_no_reach():
    none = strewn(np.random.default_rng(0), boxes=1, objects=0, extent=1.0)
    boxes, reach = within_budget(none, np.zeros(0, dtype=np.int64), AGREE)
    assert (boxes.shape, reach.shape) == ((0,), (0, 0))


def test_objects_near_a_hypothesis_score_as_all_do():
    """Where all objects are near, both ways of scoring are one."""
    from types import SimpleNamespace

    random = np.random.default_rng(2)
    pairings = strewn(random, boxes=4, objects=50, extent=8.0)
    rotation = np.linalg.qr(random.normal(size=(20, 3, 3)))[0]
    found = Hypotheses(rotation, random.uniform(0.0, 8.0, (20, 3)))
    center = pairings.center[:50]
    log_half = -1.0
    place = SimpleNamespace(
        ellipsoids=np.hstack([center, np.zeros((50, 6))]),
        tree=cKDTree(center),
        size=np.column_stack([pairings.log_distance[:50] + log_half, np.full(50, 0.15)]),
        sensor=SimpleNamespace(sight=5.0),
        in_reach=50,
    )
    usual = pairings.log_distance.reshape(4, 50)
    assert np.ptp(usual - usual[0], axis=1) == pytest.approx(np.zeros(4), abs=1e-12)
    gain = random.uniform(1.0, 9.0, len(pairings))
    every = quick_score._score_all(place, pairings, gain, found)
    near = quick_score._score_near(place, pairings, gain, found)
    assert every.max() > 1.0
    np.testing.assert_allclose(near, every, rtol=1e-9)


def test_triples_that_most_boxes_close_are_kept():
    """Five pairings of five boxes agree with each other, among forty that agree in a ring."""
    pairings = strewn(np.random.default_rng(0), boxes=5, objects=9, extent=8.0)
    right = np.array([0, 9 + 1, 18 + 2, 27 + 3, 36 + 4])  # box 0 with object 0, ...
    clique = [(a, b) for k, a in enumerate(right) for b in right[k + 1 :]]
    chance = [(8, 9 + 7), (8, 18 + 7), (9 + 7, 18 + 7), (7, 27 + 6), (7, 36 + 6), (27 + 6, 36 + 6)]
    pairs = np.array(sorted(clique + chance))
    triples = triangles(pairs, len(pairings))
    assert len(triples) == 10 + 2
    kept, strong = closed(pairings, pairs, triples, 10)
    assert set(kept.ravel().tolist()) == set(right.tolist())
    assert set(map(tuple, strong.tolist())) == {tuple(map(int, one)) for one in clique}


def paired(counts):
    """Return pairings of boxes with so many objects each, in order."""
    box = np.repeat(np.arange(len(counts)), np.array(counts, dtype=np.int64))
    rows = np.array([row for count in counts for row in range(count)], dtype=np.int64)
    numbers, rays = np.zeros(len(box)), np.zeros((len(box), 3))
    return Pairings(box, rows, rays, numbers, numbers, numbers, numbers, rays)


def all_pairs(box):
    """Return the pairs of all pairings of different boxes."""
    i, j = np.triu_indices(len(box), 1)
    return np.column_stack([i, j])[box[i] != box[j]]


def test_few_triples_of_boxes_are_all_taken():
    """Each triangle of pairs is one of three boxes, and is found once."""
    pairings = paired([2, 1, 3, 2])
    pairs = all_pairs(pairings.box)
    found = triples_by_boxes(pairings, pairs, 1000)
    assert len(found) == 2 * 1 * 3 + 2 * 1 * 2 + 2 * 3 * 2 + 1 * 3 * 2
    assert set(map(tuple, found.tolist())) == set(map(tuple, triangles(pairs, 8).tolist()))


def test_triples_of_boxes_with_few_objects_come_first():
    """Boxes 1 to 3 have two triangles, boxes 0, 1, 3 have three, and the others have six."""
    pairings = paired([3, 1, 2, 1])
    pairs = all_pairs(pairings.box)
    found = triples_by_boxes(pairings, pairs, 2)
    np.testing.assert_array_equal(pairings.box[found], [[1, 2, 3]] * 2)


def test_other_boxes_come_before_those_that_were_taken():
    pairings = paired([1] * 6)
    found = triples_by_boxes(pairings, all_pairs(pairings.box), 2)
    np.testing.assert_array_equal(found, [[0, 1, 2], [3, 4, 5]])


def test_of_too_many_triangles_evenly_spaced_ones_are_kept():
    pairings = paired([20, 20, 20])
    found = triples_by_boxes(pairings, all_pairs(pairings.box), 100)
    assert len(found) == 100
    assert set(found[:, 0].tolist()) == set(range(20))


@pytest.mark.parametrize("counts", [[], [3], [2, 2]])
def test_without_three_boxes_there_is_no_triple(counts):
    pairings = paired(counts)
    assert triples_by_boxes(pairings, all_pairs(pairings.box), 100).shape == (0, 3)


def test_as_many_objects_as_are_in_reach():
    room = rooms.furnish(
        30.0, np.full((2, 3), 0.1), np.zeros(900, dtype=int), np.random.default_rng(0)
    )
    results = rooms.map_room(room, 20, np.random.default_rng(0), everything=True)
    place = dq.PlaceMap.of(results)
    around = np.pi * (REACH * place.sensor.sight) ** 2  # one object on each square meter
    assert 0.6 * around < place.in_reach < min(1.4 * around, 201)
    nine = room.select(np.arange(9))
    small = dq.PlaceMap.of(rooms.map_room(nine, 20, np.random.default_rng(0), everything=True))
    assert small.in_reach <= 9
