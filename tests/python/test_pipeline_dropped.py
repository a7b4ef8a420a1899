"""What does not come into the map: objects without a place, and boxes held out."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import OdometryNoise
from dqslam.io import load_recording
from dqslam.pipeline import RunOptions, run
from dqslam.pipeline.hold_out import choose_held_out, describe_overlap
from dqslam.simulation import perturb_odometry

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


def with_boxes(recording, rows=slice(None), **changes):
    detections = replace(recording.detections, **changes).select(rows)
    return replace(recording, detections=detections)


def assert_is_odometry(result, recording):
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    np.testing.assert_array_equal(result.estimate.poses, path)
    assert result.estimate.object_ids.shape == (0,)
    assert (result.marginals, result.summary, result.report["solver"]) == (None, None, None)
    assert result.report["objects"] == []


@pytest.mark.parametrize("trust", [1.0, 0.9])
def test_without_a_place_for_any_object_the_odometry_is_returned(files, trust):
    recording, _ = load_recording(*files)
    corner = np.random.default_rng(1).uniform([0, 0], [500, 400], (160, 2))
    anywhere = with_boxes(recording, box=np.hstack([corner, corner + 60.0]))
    noisy = perturb_odometry(anywhere, NOISE, seed=0)
    result = run(noisy, RunOptions(trust_ids=trust, estimates_noise=True))
    assert_is_odometry(result, noisy)
    assert result.report["reprojection"]["iou_median"] is None
    why = "no place explains its boxes, or they leave its distance open"
    names = ["101", "102", "105", "109"] if trust == 1.0 else []
    assert result.report["dropped_objects"] == dict.fromkeys(names, why)


def test_no_boxes_leave_the_odometry(files):
    recording, _ = load_recording(*files)
    for rows in (slice(0), recording.detections.pose == 0, recording.detections.pose == 39):
        part = with_boxes(recording, rows)
        assert_is_odometry(run(part, RunOptions(trust_ids=0.9, estimates_noise=True)), part)
    held_out = run(with_boxes(recording, slice(20)), RunOptions(hold_out=0.99))
    assert held_out.held_out.all()
    assert_is_odometry(held_out, recording)


@pytest.mark.parametrize("online", [False, True])
@pytest.mark.parametrize("names", [{}, {0: "cup"}])
def test_a_recording_without_any_box_says_so(files, names, online):
    recording, _ = load_recording(*files)
    boxes = recording.detections.select(np.zeros(len(recording.detections), dtype=bool))
    recording = replace(recording, detections=replace(boxes, class_names=names))
    result = run(recording, online=online)
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    np.testing.assert_allclose(result.estimate.poses, path, rtol=0, atol=1e-12)
    assert result.estimate.object_ids.shape == (0,)
    assert "there is no box: the trajectory is the odometry" in result.report["warnings"]


def test_an_object_of_too_few_boxes_is_named(files):
    recording, _ = load_recording(*files)
    lamp = np.flatnonzero(recording.detections.object_id == 105)
    kept = np.ones(160, dtype=bool)
    kept[lamp[3:]] = False
    report = run(with_boxes(recording, kept)).report
    assert [entry["id"] for entry in report["objects"]] == [101, 102, 109]
    assert report["dropped_objects"] == {"105": "seen from 3 viewpoints, 4 are needed"}


def test_held_out_boxes_take_no_part(files):
    """Moved anywhere, they change nothing of the estimate."""
    recording, _ = load_recording(*files, ids="none")
    noisy = perturb_odometry(recording, NOISE, seed=0)
    options = RunOptions(hold_out=0.25, seed=3, estimates_noise=True)
    first = run(noisy, options)
    assert first.held_out.sum() == 40
    box = noisy.detections.box.copy()
    box[first.held_out] = [300.0, 200.0, 310.0, 210.0]
    other = run(with_boxes(noisy, box=box), options)
    np.testing.assert_array_equal(other.held_out, first.held_out)
    np.testing.assert_array_equal(other.estimate.poses, first.estimate.poses)
    np.testing.assert_array_equal(other.estimate.ellipsoids, first.estimate.ellipsoids)
    tested = [one.report["reprojection"] for one in (first, other)]
    assert [one["boxes"] for one in tested] == [40, 40]
    assert tested[0]["iou_median"] > 0.85
    assert tested[0]["explained_share"] == 1.0
    assert tested[1]["explained_share"] == 0.0


def test_held_out_boxes_are_called_what_they_show(files):
    recording, _ = load_recording(*files)
    result = run(recording, RunOptions(hold_out=0.25))
    np.testing.assert_array_equal(result.detections.object_id, recording.detections.object_id)
    assert result.report["reprojection"]["held_out"]
    assert result.report["boxes"]["count"] == 120
    assert not run(recording).report["reprojection"]["held_out"]


def test_boxes_are_held_out_by_the_seed():
    chosen = choose_held_out(1000, 0.3, seed=1)
    assert chosen.sum() == 300
    np.testing.assert_array_equal(chosen, choose_held_out(1000, 0.3, seed=1))
    assert not np.array_equal(chosen, choose_held_out(1000, 0.3, seed=2))
    assert not choose_held_out(1000, 0.0, seed=1).any()


@pytest.mark.parametrize("share", [-0.1, 1.0, 2.0, float("nan")])
def test_shares_to_hold_out_must_make_sense(files, share):
    with pytest.raises(ValueError, match="the share to hold out is .*, not at least 0 and below 1"):
        run(load_recording(*files)[0], RunOptions(hold_out=share))


def test_overlaps_are_described():
    overlap = np.array([0.9, 0.4, 0.0, np.nan, 0.8])
    assert describe_overlap(overlap) == {
        "boxes": 5,
        "of_mapped_classes": 4,
        "matched": 3,
        "iou_median": pytest.approx(0.8),
        "explained_share": 0.5,
    }
