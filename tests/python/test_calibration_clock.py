"""Offsets of the clocks, found with a finished map, far from the times as given."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dqslam as dq
from dqslam.calibration import scale_and_offset
from dqslam.calibration.clock import ClockError
from dqslam.pipeline.clock import with_delay

ORBIT = dq.load_scenario("orbit")


@cache
def orbit(seed, offset):
    """Return a recording without ids, whose images are later than their times."""
    calibration = ORBIT.calibration.model_copy(update={"time_offset_s": offset})
    recording, _ = dq.simulate(ORBIT.model_copy(update={"calibration": calibration}), seed=seed)
    boxes = recording.detections
    unnamed = replace(boxes, object_id=np.full(len(boxes), -1))
    return replace(recording, positions=None, detections=unnamed)


@pytest.mark.parametrize(("seed", "offset"), [(21, -0.4), (22, 0.9)])
def test_a_run_doubts_clocks_that_are_some_images_apart(seed, offset):
    report = dq.run(orbit(seed, offset)).report
    clock = report["clock"]
    assert clock["sure"]
    assert clock["rate"] == 0.0
    assert abs(clock["seconds"] - offset) < 3.0 * clock["sigma_s"]
    assert clock["sigma_s"] < 0.1
    [doubt] = report["doubts"]
    assert "later" in doubt if offset > 0 else "earlier" in doubt
    assert f"--time-offset {clock['seconds']:.3g}" in doubt
    # The score of a delay says less than half of it: one number is enough.
    assert report["warnings"] == [doubt]


def test_nothing_is_said_of_clocks_that_agree():
    report = dq.run(orbit(23, 0.0)).report
    assert abs(report["clock"]["seconds"]) < 3.0 * report["clock"]["sigma_s"]
    assert not report["clock"]["sure"]
    assert report["doubts"] == []


def test_a_wrong_rate_is_told_from_an_offset():
    """The clock of the boxes loses 3 % from the first image on."""
    recording = orbit(24, 0.0)
    times, boxes = recording.timestamps, recording.detections
    # Images of 0.2 s, by a clock on which each is earlier than it was.
    wrong = times[boxes.pose] / 1.03
    pose = np.abs(times[None] - wrong[:, None]).argmin(axis=1)
    slow = replace(recording, detections=replace(boxes, pose=pose))
    report = dq.run(slow).report
    assert report["clock"]["sure"]
    assert report["clock"]["rate"] == pytest.approx(0.03, abs=0.012)
    [doubt] = report["doubts"]
    assert "another rate" in doubt
    assert "--time-scale 1.0" in doubt


@pytest.mark.parametrize("offset", [-0.4, 0.1])
def test_an_estimated_offset_is_as_sure_as_it_says(offset):
    """The motion next to a pose alone says -0.08 ± 0.008 s on such a recording, wherever it is."""
    result = dq.run(orbit(21, offset), dq.RunOptions(estimate=("time_offset",)))
    found = result.report["estimated_calibration"]["time_offset"]
    assert abs(found["value"] - offset) < 3.0 * found["sigma"]
    assert found["sigma"] < 0.1
    assert result.report["doubts"] == []


def test_boxes_move_to_the_poses_of_later_times():
    recording = orbit(21, 0.0)
    times, boxes = recording.timestamps, recording.detections
    later = with_delay(recording, 0.4)  # two images
    kept = times[boxes.pose] + 0.4 <= times[-1] + 1e-9
    np.testing.assert_array_equal(later.timestamps, times)
    np.testing.assert_array_equal(later.detections.pose, boxes.pose[kept] + 2)
    np.testing.assert_array_equal(later.detections.box, boxes.box[kept])
    between = with_delay(recording, 0.1)
    found = between.timestamps[between.detections.pose]
    np.testing.assert_allclose(found, times[boxes.pose[: len(found)]] + 0.1, atol=1e-9)
    assert len(between.timestamps) > len(times)
    assert len(with_delay(recording, 1000.0).detections) == 0


def test_the_offset_belongs_to_the_factor_as_it_is_written():
    """At the middle of a recording since 1970, both together add the seconds."""
    middle = 1.7e9
    scale, offset = scale_and_offset(0.0123456, 0.5, middle)
    assert scale == 1.0123
    assert scale * middle + offset == pytest.approx(middle + 0.5, abs=1e-6)
    error = ClockError(0.5, 0.01, 100.0, 0.0123456, middle)
    assert f"--time-scale 1.0123 --time-offset {offset:.3f}" in str(error)
