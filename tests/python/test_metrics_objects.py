import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam.metrics import match_by_id, match_nearest, orientation_error, size_error

AXES = np.array([0.3, 0.1, 0.2])


def pairs(matches):
    return list(zip(matches.row.tolist(), matches.true_row.tolist(), strict=True))


def test_by_id():
    assert pairs(match_by_id(np.array([9, 4, 7]), np.array([7, 8, 9]))) == [(0, 2), (2, 0)]
    assert pairs(match_by_id(np.array([], dtype=int), np.array([7]))) == []


def test_nearest_by_hand():
    """Both objects are nearest to the first true one; the second still finds its own."""
    centers = np.array([[0.0, 0, 0], [0.4, 0, 0], [9, 9, 9]])
    true = np.array([[0.3, 0, 0], [1.0, 0, 0]])
    gates = np.array([1.0, 1.0])
    names = ["cup"] * 3
    assert pairs(match_nearest(centers, names, true, ["cup"] * 2, gates)) == [(0, 0), (1, 1)]
    # The gate of the second is too small for the first pairing: the nearer of both gets the first.
    narrow = np.array([1.0, 0.1])
    assert pairs(match_nearest(centers, names, true, ["cup"] * 2, narrow)) == [(1, 0)]


def test_nearest_heeds_classes_unless_told_not_to():
    centers, gates = np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([2.0, 2.0])
    true = np.array([[0.1, 0, 0], [1.1, 0, 0]])
    names, swapped = ["Car ", "van"], ["VAN", "car"]
    assert pairs(match_nearest(centers, names, true, swapped, gates)) == [(0, 1), (1, 0)]
    assert pairs(match_nearest(centers, names, true, None, gates)) == [(0, 0), (1, 1)]
    assert pairs(match_nearest(centers, names, true, ["bus", "tram"], gates)) == []


def test_nearest_is_the_best_of_all_choices():
    random = np.random.default_rng(0)
    for _ in range(20):
        centers, true = random.uniform(0, 2, (4, 3)), random.uniform(0, 2, (5, 3))
        distance = np.linalg.norm(centers[:, None] - true[None], axis=2)
        best = (0, 0.0)
        for choice in itertools.permutations(range(5), 4):
            good = [distance[i, j] for i, j in enumerate(choice) if distance[i, j] <= 0.8]
            best = min(best, (-len(good), sum(good)))
        found = match_nearest(centers, ["a"] * 4, true, ["a"] * 5, np.full(5, 0.8))
        assert len(found.row) == -best[0]
        assert distance[found.row, found.true_row].sum() == pytest.approx(best[1])


def test_nothing_matches_nothing():
    none = np.zeros((0, 3))
    assert pairs(match_nearest(none, [], np.zeros((1, 3)), ["a"], np.ones(1))) == []
    assert pairs(match_nearest(np.zeros((1, 3)), ["a"], none, [], np.zeros(0))) == []


def test_sizes_by_hand_whatever_the_order():
    assert size_error(np.array([0.1, 0.2, 0.33]), AXES) == pytest.approx(0.1 / 3)
    assert size_error(AXES * 2, AXES) == pytest.approx(1.0)
    assert size_error(AXES / 2, AXES) == pytest.approx(0.5)


TRUE = Rotation.from_rotvec([0.4, -0.2, 0.9])


def all_names():
    """Yield the 24 ways to name the axes of an ellipsoid: rotations and the order of lengths."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product([-1, 1], repeat=3):
            matrix = np.eye(3)[:, order] * signs
            if np.linalg.det(matrix) > 0:
                yield matrix, list(order)


def test_there_are_24_names():
    assert len(list(all_names())) == 24


@pytest.mark.parametrize("angle", [0.0, 5.0, 30.0, 90.0])
def test_orientation_is_the_same_by_any_name(angle):
    """Turned about the true z axis, whose length is the middle one."""
    turn = Rotation.from_rotvec([0, 0, np.radians(angle)])
    rotation = (TRUE * turn).as_matrix()
    for name, order in all_names():
        found = orientation_error(rotation @ name, AXES[order], TRUE.as_matrix(), AXES)
        assert found == pytest.approx(angle, abs=1e-5)


def test_no_angle_is_beyond_the_symmetry():
    """A half turn about any axis is no turn; about the diagonal 120 degrees are the most."""
    for axis in np.eye(3):
        rotation = (TRUE * Rotation.from_rotvec(np.radians(170) * axis)).as_matrix()
        assert orientation_error(rotation, AXES, TRUE.as_matrix(), AXES) == pytest.approx(10.0)
    for turn in Rotation.random(200, random_state=0):
        assert orientation_error(turn.as_matrix(), AXES, np.eye(3), AXES) <= 120.0 + 1e-9


def test_the_turn_about_an_axis_of_symmetry_is_free():
    for lengths, axis in (([1.0, 1.1, 3.0], [0, 0, 1]), ([1.0, 3.0, 3.3], [1, 0, 0])):
        lengths = np.array(lengths)
        about = TRUE * Rotation.from_rotvec(0.8 * np.array(axis))
        found = orientation_error(about.as_matrix(), lengths, TRUE.as_matrix(), lengths)
        assert found == pytest.approx(0.0, abs=1e-5)
        tilted = about * Rotation.from_rotvec([0, np.radians(20), 0])
        found = orientation_error(tilted.as_matrix(), lengths, TRUE.as_matrix(), lengths)
        assert found == pytest.approx(20.0)


def test_a_ball_has_no_orientation():
    for lengths in ([1.0, 1.0, 1.0], [1.0, 1.15, 1.3]):
        assert np.isnan(orientation_error(np.eye(3), AXES, np.eye(3), np.array(lengths)))
