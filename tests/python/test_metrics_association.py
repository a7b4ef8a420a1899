import numpy as np
import pytest

from dqslam.metrics import score_association


def test_by_hand():
    """Object 7 has three boxes of A and one of B, object 8 two of B; one of A is left alone."""
    object_id = [7, 7, 7, 7, 8, 8, -1]
    true_id = [0, 0, 0, 1, 1, 1, 0]
    found = score_association([0, 1, 2, 0, 1, 2, 3], object_id, true_id)
    assert found.boxes == 7
    assert found.precision == pytest.approx((3 + 1) / (6 + 1))
    assert found.recall == pytest.approx((3 + 1) / (6 + 3))
    assert found.purity == pytest.approx(5 / 6)
    assert found.id_switches == 1  # B: 7, 8, 8
    assert (found.found, found.missed, found.split, found.invented) == (2, 0, 0, 0)


def test_perfect_whatever_the_names():
    true_id = np.repeat([3, 1, 4], 5)
    found = score_association(np.tile(range(5), 3), 10 - true_id, true_id)
    assert (found.precision, found.recall, found.purity) == (1.0, 1.0, 1.0)
    assert (found.id_switches, found.found, found.missed) == (0, 3, 0)


def test_switches_are_counted_in_time_not_by_row():
    pose = [3, 0, 2, 1]
    found = score_association(pose, [5, 4, 5, 4], [0, 0, 0, 0])  # in time: 4 4 5 5
    assert found.id_switches == 1
    found = score_association(pose, [4, 4, 5, 5], [0, 0, 0, 0])  # in time: 4 5 5 4
    assert found.id_switches == 2
    found = score_association(pose, [4, 4, -1, 4], [0, 0, 0, 0])  # a gap is no switch
    assert found.id_switches == 0


def test_split_missed_and_invented():
    """A is two objects, B only a minor part of one, object 9 is of nothing."""
    object_id = [1, 1, 1, 2, 2, 9, 9, 9]
    true_id = [0, 0, 5, 0, 0, -1, -1, 5]
    found = score_association(np.arange(8), object_id, true_id)
    assert (found.found, found.missed, found.split, found.invented) == (1, 1, 1, 1)
    assert found.precision == pytest.approx((1 + 1) / (3 + 1 + 3))
    assert found.recall == pytest.approx((1 + 1) / (6 + 1))


def test_all_in_one_has_recall_but_no_precision_and_none_has_neither():
    true_id = np.repeat(np.arange(10), 2)
    one = score_association(np.arange(20), np.zeros(20, dtype=int), true_id)
    assert (one.recall, one.precision) == (1.0, pytest.approx(10 / 190))
    none = score_association(np.arange(20), np.full(20, -1), true_id)
    assert none.recall == 0.0
    assert np.isnan(none.precision)
    assert np.isnan(none.purity)
    assert (none.found, none.missed) == (0, 10)


def test_pairs_are_those_of_brute_force():
    random = np.random.default_rng(2)
    object_id, true_id = random.integers(-1, 4, 60), random.integers(-1, 4, 60)
    together = taken = true = 0
    for i in range(60):
        for j in range(i):
            same = object_id[i] == object_id[j] >= 0
            same_true = true_id[i] == true_id[j] >= 0
            together, taken, true = together + (same and same_true), taken + same, true + same_true
    found = score_association(np.arange(60), object_id, true_id)
    assert found.precision == pytest.approx(together / taken)
    assert found.recall == pytest.approx(together / true)


def test_tables_of_different_length_are_refused():
    with pytest.raises(ValueError, match=r"true_id: expected shape \(3\), got \(2,\)"):
        score_association([0, 1, 2], [0, 1, 2], [0, 1])


def test_ids_may_be_any_number():
    pose = np.arange(4)
    score = score_association(pose, np.array([10**15, 10**15, 3, 3]), np.array([1, 1, 2, 10**14]))
    assert (score.precision, score.recall, score.purity) == (0.5, 1.0, 0.75)
