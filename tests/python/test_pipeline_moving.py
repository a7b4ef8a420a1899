"""A run of a street: what moves is not in its map, but in its tracks and in its report."""

from dataclasses import replace

import numpy as np
from benchmarks.tracks.street import make_street

import dqslam as dq


def test_a_run_tracks_what_moves(tmp_path):
    street = make_street("oncoming", 3)
    result = dq.run(street.recording)
    assert 0 not in result.estimate.object_ids
    (track,) = [one for one in result.estimate.tracks if np.median(one.speeds) > 5.0]
    assert track.class_name == "car" and track.behavior == "moves"
    assert np.median(np.abs(track.speeds - street.speeds[track.pose])) < 2.0
    report = result.report["tracks"]
    assert report["ground"]["kind"] != "unknown"
    (moving,) = [one for one in report["moving"] if one["id"] == track.track_id]
    assert moving["images"] == len(track)
    assert moving["speed_median_m_s"] == float(np.median(track.speeds))
    dq.save_estimate(result.estimate, tmp_path / "results")
    assert len(dq.load_results(tmp_path / "results").tracks) == len(result.estimate.tracks)


def test_a_car_ahead_is_one_track_and_nothing_else_moves():
    street = make_street("following", 0)
    result = dq.run(street.recording)
    (track,) = result.estimate.tracks
    assert np.median(np.abs(track.speeds - street.speeds[track.pose])) < 1.0
    assert 0 not in result.estimate.object_ids


def test_a_session_that_has_ended_has_no_mover_in_its_map():
    street = make_street("oncoming", 3)
    result = dq.run(street.recording, online=True)
    assert 0 not in result.estimate.object_ids and len(result.estimate.object_ids) >= 5
    (track,) = [one for one in result.estimate.tracks if np.median(one.speeds) > 5.0]
    assert np.median(np.abs(track.speeds - street.speeds[track.pose])) < 2.0
    poses = result.estimate.poses
    assert np.linalg.norm(poses[:, :3] - street.true_path[:, :3], axis=1).max() < 0.2


def test_a_recording_without_boxes_has_no_tracks():
    street = make_street("parked", 0)
    none = street.recording.detections.select(np.zeros(0, dtype=int))
    result = dq.run(replace(street.recording, detections=none))
    assert result.estimate.tracks == ()
    assert result.report["tracks"]["moving"] == []
