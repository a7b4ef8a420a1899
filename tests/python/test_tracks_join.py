"""Tracklets of one car that were cut, and of two cars, on simulated streets."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.tracks.street import NOISE, make_street

from dqslam.tracks import estimate_tracks
from dqslam.tracks.candidates import group_boxes, make_scene
from dqslam.tracks.join import join_tracklets

SECOND_CAR = 100


def shown(street, images, number=0):
    """The rows of the boxes that show a thing in some images."""
    detections = street.recording.detections
    return np.flatnonzero((detections.object_id == number) & np.isin(detections.pose, images))


def scene_of(street, recording=None):
    recording = recording or street.recording
    ids = recording.detections.object_id
    rows = np.where((ids > 0) & (ids < SECOND_CAR), ids - 1, -1)
    return make_scene(recording, street.path, street.ellipsoids, rows, NOISE, None)


@pytest.mark.parametrize(
    ("kind", "found_at"), [("following", 20), ("oncoming", 14), ("crossing", 14)]
)
def test_what_is_lost_and_found_is_joined(kind, found_at):
    """It is seen for a second, not for 1.1 s or 0.5 s, and again for a second."""
    street = make_street(kind, 0)
    parts = [shown(street, np.arange(10)), shown(street, np.arange(found_at, found_at + 10))]
    (whole,) = join_tracklets(scene_of(street), parts)
    np.testing.assert_array_equal(whole, np.concatenate(parts))


def test_three_parts_are_one_chain_whatever_comes_between():
    street = make_street("following", 1)
    parts = [shown(street, np.arange(first, first + 8)) for first in (0, 12, 24)]
    beside = shown(street, np.arange(40), number=4)
    found = join_tracklets(scene_of(street), [parts[0], beside, *parts[1:]])
    assert [len(rows) for rows in found] == [24, len(beside)]
    np.testing.assert_array_equal(found[0], np.concatenate(parts))


def with_car_ahead(street, ahead_m, seed):
    """The street, and from its image 20 on, instead of its car, one that goes ahead of it.

    Of the same size, its boxes are those of the first one seen from so much farther away.
    """
    detections, camera = street.recording.detections, street.recording.camera
    rows = shown(street, np.arange(20, 40))
    images = detections.pose[rows]
    depth = street.centers[images, 0] - street.true_path[images, 0]
    middle = np.array([camera.cx, camera.cy, camera.cx, camera.cy])
    box, ids = detections.box.copy(), detections.object_id.copy()
    smaller = (depth / (depth + ahead_m))[:, None]
    jitter = 0.5 * np.random.default_rng(seed).normal(size=(len(rows), 4))
    box[rows] = middle + smaller * (box[rows] - middle) + jitter
    ids[rows] = SECOND_CAR
    return replace(street.recording, detections=replace(detections, box=box, object_id=ids))


@pytest.mark.parametrize("ahead_m", [6.0, 12.0])
def test_a_car_that_goes_ahead_of_another_one_is_not_the_same(ahead_m):
    """It has the same speed on the same lane, and appears 0.6 s after the other one is lost."""
    street = make_street("following", 2)
    recording = with_car_ahead(street, ahead_m, seed=0)
    parts = [shown(street, np.arange(15)), shown(street, np.arange(20, 40))]
    found = join_tracklets(scene_of(street, recording), parts)
    assert [rows.tolist() for rows in found] == [rows.tolist() for rows in parts]


def test_what_nothing_is_known_of_stays_as_it_is():
    street = make_street("following", 0)
    parts = [shown(street, [0]), shown(street, np.arange(1, 9)), shown(street, np.arange(9, 30))]
    named = replace(street.recording.detections, class_names={0: "kite"})
    unknown = scene_of(street, replace(street.recording, detections=named))
    assert len(join_tracklets(unknown, parts)) == 3  # nothing tells the size of a kite
    assert [len(rows) for rows in join_tracklets(scene_of(street), parts)] == [1, 29]
    assert join_tracklets(scene_of(street), []) == []


@pytest.mark.parametrize("final", [True, False])
def test_ids_that_are_final_are_of_two_things_and_others_may_be_of_one(final):
    street = make_street("following", 0)
    detections = street.recording.detections
    late = shown(street, np.arange(18, 40))
    ids = detections.object_id.copy()
    ids[late] = SECOND_CAR
    keep = np.ones(len(ids), dtype=bool)
    keep[shown(street, np.arange(10, 18))] = False
    recording = replace(
        street.recording, detections=replace(detections, object_id=ids).select(keep)
    )
    ids = recording.detections.object_id
    is_parked = (ids > 0) & (ids < SECOND_CAR)
    assert len(group_boxes(recording, ~is_parked, final=final)) == 2
    found = estimate_tracks(
        recording,
        street.path,
        street.ellipsoids,
        np.where(is_parked, ids - 1, -1),
        final=final,
        box_noise=NOISE,
    )
    assert [len(track) for track in found.tracks] == ([10, 22] if final else [32])
    rows = np.flatnonzero(~is_parked)
    np.testing.assert_array_equal(found.track_of_box[rows], np.repeat([0, int(final)], [10, 22]))
