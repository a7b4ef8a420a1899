"""What moves in the last images of a session."""

import numpy as np
import pytest
from benchmarks.tracks.street import NOISE, make_street

import dqslam as dq
from dqslam.online.moving import recent_window
from dqslam.online.readout import read_assignments
from dqslam.online.state import RECENT_IMAGES


def drive(street, **settings):
    """A session that has been driven through a street."""
    recording = street.recording
    slam = dq.OnlineSlam(
        recording.camera,
        pose_model=recording.odometry.pose_model,
        first_pose=recording.odometry.first_pose,
        box_noise=NOISE,
        **settings,
    )
    for step in dq.steps_of(recording):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    return slam


@pytest.mark.parametrize("finds_movers", [False, True])
def test_a_car_ahead_has_a_position_and_a_speed(finds_movers):
    """Whether or not the map believes at first that it rests."""
    street = make_street("following", 1)
    slam = drive(street, finds_movers=finds_movers)
    (track,) = slam.tracks()
    last = int(track.pose[-1])
    assert last == len(slam) - 1 and track.class_name == "car"
    assert abs(track.speeds[-1] - street.speeds[last]) < 1.5
    off = track.centers[-1] - street.centers[last]
    assert off @ np.linalg.solve(track.center_covariances[-1], off) < 16.0


def test_a_parked_car_has_no_track():
    assert drive(make_street("parked", 0)).tracks() == ()


def test_too_few_steps_have_no_tracks():
    street = make_street("following", 1)
    slam = dq.OnlineSlam(street.recording.camera)
    assert slam.tracks() == ()
    for step, _ in zip(dq.steps_of(street.recording), range(3), strict=False):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        assert slam.tracks() == ()


@pytest.mark.parametrize("trust_ids", [1.0, 0.9])
def test_the_window_is_the_end_of_the_session(trust_ids):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    slam = dq.OnlineSlam(recording.camera, trust_ids=trust_ids)
    for step, _ in zip(dq.steps_of(recording), range(100), strict=False):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    window = recent_window(slam._state)
    assert window.begin == 100 - RECENT_IMAGES == 60
    inside = (recording.detections.pose >= 60) & (recording.detections.pose < 100)
    boxes = recording.detections.select(inside)
    np.testing.assert_array_equal(window.recording.detections.pose, boxes.pose - 60)
    np.testing.assert_array_equal(window.recording.detections.box, boxes.box)
    for begin in (0, 60, 99):
        some = read_assignments(slam._state, begin)
        whole = slam.assignments[begin:]
        assert len(some) == 100 - begin
        for one, other in zip(some, whole, strict=True):
            np.testing.assert_array_equal(one, other)
    shown = np.concatenate(slam.assignments[60:])
    ids = np.array([*slam._state.registry.ids, -1])
    mapped = np.isin(shown, slam.objects.object_ids)
    np.testing.assert_array_equal(ids[window.object_rows], np.where(mapped, shown, -1))
