"""Labels by hand: boxes that are given, taken, cut and joined, and what follows for objects."""

import numpy as np
import pytest

from dqslam.association.labels import Labels


@pytest.fixture
def labels():
    """Five boxes of three tracklets and two classes; object 0 has the first two tracklets."""
    made = Labels(np.array([0, 0, 1, 2, 2]), np.array([0, 1, 0, 1, 1]), 2)
    made.add_object(np.array([0, 1, 2]))
    made.add_object(np.array([3]))
    return made


def test_boxes_count_as_votes(labels):
    np.testing.assert_array_equal(labels.object_rows, [0, 0, 0, 1, -1])
    np.testing.assert_array_equal(labels.votes, [[2, 1], [0, 1]])
    np.testing.assert_array_equal(labels.box_counts, [3, 1])
    np.testing.assert_array_equal(labels.object_of_tracklet, [0, 0, 1])
    np.testing.assert_allclose(
        labels.class_probability(np.array([0, 1]), np.array([0, 1])), [[2 / 3, 0.02], [1 / 3, 1]]
    )
    labels.release(np.array([0, 4]))
    labels.assign(np.array([0, 4]), np.array([-1, 1]))
    np.testing.assert_array_equal(labels.object_rows, [-1, 0, 0, 1, 1])
    np.testing.assert_array_equal(labels.votes, [[1, 1], [0, 2]])


def test_a_box_is_a_stranger_as_long_as_its_tracklet_has_no_object(labels):
    rows = np.arange(5)
    np.testing.assert_array_equal(labels.are_strangers(rows), [False] * 5)
    labels.cut_tracklet(np.array([4]))
    np.testing.assert_array_equal(labels.tracklets, [0, 0, 1, 2, 3])
    np.testing.assert_array_equal(labels.are_strangers(rows), [False] * 4 + [True])


def test_objects_that_are_joined_keep_the_row_of_the_first(labels):
    labels.join_objects(0, 1)
    np.testing.assert_array_equal(labels.object_rows, [0, 0, 0, 0, -1])
    np.testing.assert_array_equal(labels.object_of_tracklet, [0, 0, 0])
    np.testing.assert_array_equal(labels.votes, [[2, 2], [0, 0]])
    np.testing.assert_array_equal(labels.joined_into, [0, 0])


def test_boxes_of_objects_that_are_given_up_wait(labels):
    labels.give_up(np.array([0]))
    np.testing.assert_array_equal(labels.object_rows, [-1, -1, -1, 1, -1])
    np.testing.assert_array_equal(labels.object_of_tracklet, [-1, -1, 1])
    np.testing.assert_array_equal(labels.shown_objects, [1])
    np.testing.assert_array_equal(labels.box_counts, [0, 1])


def test_what_is_left_out_takes_no_part(labels):
    labels.dropped = {0: "for a reason"}
    np.testing.assert_array_equal(labels.takes_part, [False, True, False])


def test_a_part_is_changed_by_itself(labels):
    part = labels.since(2)
    np.testing.assert_array_equal(part.object_rows, [0, 1, -1])
    part.assign(np.array([2]), np.array([0]))
    part.add_object(np.zeros(0, dtype=np.int64))
    part.cut_tracklet(np.array([1]))
    part.dropped[1] = "for a reason"
    np.testing.assert_array_equal(labels.object_rows, [0, 0, 0, 1, -1])
    np.testing.assert_array_equal(labels.votes, [[2, 1], [0, 1]])
    np.testing.assert_array_equal(labels.tracklets, [0, 0, 1, 2, 2])
    assert len(labels.object_of_tracklet) == 3
    assert labels.dropped == {}


def test_there_is_room_for_what_comes(labels):
    before = labels.votes
    labels.make_room(tracklets=5, objects=3, classes=3)
    np.testing.assert_array_equal(labels.votes, [[2, 1, 0], [0, 1, 0], [0, 0, 0]])
    np.testing.assert_array_equal(labels.object_of_tracklet, [0, 0, 1, -1, -1])
    np.testing.assert_array_equal(labels.joined_into, [0, 1, 2])
    labels.add_boxes(np.array([4]), np.array([2]))
    np.testing.assert_array_equal(labels.object_rows, [0, 0, 0, 1, -1, -1])
    np.testing.assert_array_equal(before, [[2, 1], [0, 1]])
