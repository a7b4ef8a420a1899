"""Ids of a session's objects."""

from dqslam._ids import ObjectId
from dqslam.online.objects import ANY_ID, Registry


def test_ids_that_are_taken_or_not_given_are_replaced_by_free_ones():
    registry = Registry([ObjectId(5), ANY_ID, ObjectId(5)])
    assert registry.ids == [5, 6, 7]
    assert registry.row_of == {5: 0, 6: 1, 7: 2}


def test_an_object_that_is_given_up_leaves_its_id_to_another_one():
    registry = Registry([ObjectId(5), ObjectId(9)])
    registry.release(ObjectId(5))
    assert (registry.ids, registry.row_of) == ([10, 9], {9: 1, 10: 0})
    registry.register([ObjectId(5)])
    assert (registry.ids, registry.row_of) == ([10, 9, 5], {9: 1, 10: 0, 5: 2})
