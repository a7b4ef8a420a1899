"""Tracks of simulated streets, whose boxes share no code with the package's."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.tracks.simulated import track_street
from benchmarks.tracks.street import CAMERA, NOISE, make_street

import dqslam as dq
from dqslam.tracks import estimate_tracks, find_moving
from dqslam.tracks.candidates import group_boxes, one_an_image, thinned
from dqslam.tracks.sizes import body_size


@pytest.mark.parametrize("kind", ["oncoming", "crossing", "following"])
def test_what_moves_is_tracked(kind):
    found = [track_street(make_street(kind, seed)) for seed in range(2)]
    assert [one.behavior for one in found] == ["moves", "moves"]
    assert np.median(np.concatenate([one.speed for one in found])) < 1.5
    assert np.mean(np.concatenate([one.nees for one in found])) < 3.0


def test_what_leaves_its_place_stops_and_goes():
    outcome = track_street(make_street("leaving", 0))
    assert outcome.behavior == "stops and goes"
    assert np.median(outcome.speed) < 1.0


def test_what_is_parked_rests():
    assert [track_street(make_street("parked", seed)).behavior for seed in (0, 1)] == ["rests"] * 2


def tracked(street, **changes):
    recording = replace(
        street.recording, detections=replace(street.recording.detections, **changes)
    )
    rows = street.recording.detections.object_id - 1
    return estimate_tracks(
        recording, street.path, street.ellipsoids, rows, final=True, box_noise=NOISE
    )


def test_where_data_do_not_carry_an_answer_it_is_said():
    street = make_street("oncoming", 0)
    ((rows, why),) = tracked(street, class_names={0: "kite"}).unknown
    assert why.startswith("nothing tells how large a kite is")
    assert (street.recording.detections.object_id[rows] == 0).all()
    kept = np.flatnonzero(street.recording.detections.object_id == 0)[3:]
    detections = street.recording.detections
    few = np.delete(np.arange(len(detections)), kept)
    short = replace(street.recording, detections=detections.select(few))
    found = estimate_tracks(
        short,
        street.path,
        street.ellipsoids,
        short.detections.object_id - 1,
        final=True,
        box_noise=NOISE,
    )
    assert [reason for _, reason in found.unknown] == ["seen in 3 images, 4 are needed"]


def test_of_what_is_never_seen_at_its_whole_height_nothing_is_said():
    """A parked car beside the camera, whose boxes end at the right and at the lower border."""
    street = make_street("oncoming", 3)
    rows = np.where(street.recording.detections.object_id == 3, -1, 0)
    found = estimate_tracks(
        street.recording, street.path, street.ellipsoids[:1], rows, final=True, box_noise=NOISE
    )
    assert found.tracks == ()
    assert found.unknown[0][1] == "its whole height is seen in 0 images, 4 are needed"


def test_a_track_is_in_the_images_that_show_it_and_includes_the_path():
    street = make_street("following", 1)
    (track,) = tracked(street).tracks
    shown = street.recording.detections.pose[street.recording.detections.object_id == 0]
    np.testing.assert_array_equal(track.pose, shown)
    sure = np.trace(track.center_covariances, axis1=1, axis2=2)
    whole = street.path_covariance
    with_path = estimate_tracks(
        street.recording,
        street.path,
        street.ellipsoids,
        street.recording.detections.object_id - 1,
        final=True,
        box_noise=NOISE,
        path_covariance=lambda images: whole[
            np.ix_(*[(6 * images[:, None] + np.arange(6)).ravel()] * 2)
        ],
    ).tracks[0]
    assert (np.trace(with_path.center_covariances, axis1=1, axis2=2) >= sure).all()
    # Forward is where it goes, to the first order of a step.
    forward = np.column_stack([np.cos(track.headings), np.sin(track.headings)])
    steps = np.diff(track.centers[:, :2], axis=0)
    turned = tracked(street).ground.world_from_ground[:, :2]
    along = np.sum((np.diff(track.centers, axis=0) @ turned) * forward[:-1], axis=1)
    np.testing.assert_allclose(along, np.linalg.norm(steps, axis=1), atol=0.02)


def test_an_oncoming_car_that_the_map_has_at_rest_is_found_to_move():
    """Its ellipsoid is anywhere: only boxes, size and ground count."""
    street = make_street("oncoming", 1)
    ids = street.recording.detections.object_id
    ellipsoids = np.concatenate([street.ellipsoids[:1], street.ellipsoids])
    path = street.true_path
    moving = find_moving(street.recording, path, ellipsoids, ids, box_noise=NOISE)
    assert list(moving) == [0]
    assert moving[0].startswith("as a car on the ground it moves, with a probability of ")


def test_boxes_are_grouped_by_final_ids_or_by_tracklets():
    boxes = dq.Detections(
        pose=[0, 0, 1, 1, 2],
        box=[
            [100, 100, 150, 150],
            [400, 100, 450, 150],
            [102, 100, 152, 150],
            [402, 100, 452, 150],
            [104, 100, 154, 150],
        ],
        score=np.ones(5),
        class_id=np.zeros(5, dtype=int),
        object_id=[7, 3, 7, 3, 7],
        class_names={0: "car"},
    )
    odometry = dq.Odometry.from_poses(
        np.tile([0.0, 0, 0, 0, 0, 0, 1], (3, 1)), covariance=np.eye(6)
    )
    recording = dq.Recording(CAMERA, [0.0, 0.1, 0.2], odometry, boxes)
    free = np.array([True, True, True, False, True])
    groups = group_boxes(recording, free, final=True)
    assert [group.tolist() for group in groups] == [[1], [0, 2, 4]]
    unknown = replace(recording, detections=replace(boxes, object_id=np.full(5, -1)))
    groups = group_boxes(unknown, free, final=False)
    assert sorted(group.tolist() for group in groups) == [[0, 2, 4], [1]]
    assert group_boxes(recording, np.zeros(5, dtype=bool), final=True) == []
    twice = replace(
        recording, detections=replace(boxes, pose=[0, 0, 0, 1, 2], score=[1, 1, 2, 1, 1])
    )
    assert one_an_image(twice, np.array([0, 2, 4])).tolist() == [2, 4]
    assert thinned(np.arange(10), most=4).tolist() == [0, 3, 6, 9]


def test_a_size_that_is_told_goes_before_that_of_traffic():
    """A car has proportions of 4.3 x 1.8 x 1.5 m; the told median semi-axis is 2 m."""
    usual, none = body_size("Car"), body_size("cup")
    assert none is None
    np.testing.assert_allclose(np.exp(usual.log_half), [2.15, 0.9, 0.75])
    priors = dq.SizePriors({"Car": dq.SizePrior(np.log(2.0), 0.3)})
    told = body_size("Car", priors)
    np.testing.assert_allclose(told.log_half.mean(), np.log(2.0))
    np.testing.assert_allclose(np.diff(told.log_half), np.diff(usual.log_half))
    assert np.linalg.inv(told.precision)[0, 1] == pytest.approx(0.3**2)
    assert body_size("cup", dq.SizePriors({"cup": dq.SizePrior()})) is not None
