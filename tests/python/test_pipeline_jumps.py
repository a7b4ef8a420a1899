"""Maps that are torn where the odometry jumps."""

import re
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.pipeline import run_files
from dqslam.pipeline.jumps import doubt_jumps, doubt_torn
from dqslam.pipeline.options import RunFilesOptions
from planted_maps import landmarks

CLASSES = ["cup", "book", "cup", "mouse", "bowl", "book", "lamp", "cup"]
JUMP = 60  #: the step of the odometry that jumps
OFFSET = np.array([0.6, 0.0, -0.8, 0.0, 0.0, 0.0, 1.0])  # 1 m


def torn(after=None, classes_after=None, ids_after=None):
    """Return a map of 8 objects seen up to 10 s, and of as many seen later: map, times, ids."""
    before = np.random.default_rng(3).uniform(-2, 2, (8, 3))
    after = before + [3.0, 4.0, 0.0] if after is None else after
    both = landmarks(np.vstack([before, after]), CLASSES + (classes_after or CLASSES))
    ids = both.object_ids.copy()
    if ids_after is not None:
        ids[8:] = ids_after
    times = np.repeat(np.arange(20.0), 8)
    seen = np.concatenate([np.tile(ids[:8], 10), np.tile(ids[8:], 10)])
    return both, times, seen


def test_objects_that_are_there_twice_are_told():
    [doubt] = doubt_torn(*torn(), np.array([9.0]))
    assert "jumps at 9 s, and 8 objects are in the map twice" in doubt
    assert "5 m away" in doubt  # 3 and 4 m along two axes
    [(turn, x, y, z)] = re.findall(r"turned by (\S+) deg and moved by (\S+) (\S+) (\S+) m", doubt)
    assert float(turn) == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose([float(x), float(y), float(z)], [3.0, 4.0, 0.0], atol=1e-3)
    assert "with --until 9 and with --from 10, and join their maps by `dqslam merge`" in doubt


def test_times_since_1970_are_said_to_the_microsecond():
    both, times, seen = torn()
    [doubt] = doubt_torn(both, times + 1.7e9 + 0.25, seen, np.array([9.25 + 1.7e9]))
    assert "jumps at 1700000009.25 s" in doubt
    assert "--until 1700000009.25 and with --from 1700000010.25" in doubt


def test_each_jump_is_told():
    """Objects of the parts between jumps are compared, not those of all that comes before."""
    both, times, seen = torn()
    third = landmarks(np.vstack([both.centers, both.centers[:8] + [0.0, 0.0, 7.0]]), CLASSES * 3)
    times = np.concatenate([times, times[:80] + 20.0])
    seen = np.concatenate([seen, np.tile(third.object_ids[16:], 10)])
    doubts = doubt_torn(third, times, seen, np.array([9.0, 19.0]))
    assert [re.findall(r"at (\d+) s|(\S+) m away", doubt) for doubt in doubts] == [
        [("9", ""), ("", "5")],
        [("19", ""), ("", "8.6")],  # 3, 4 and 7 m: the root of 74
    ]


def test_nothing_is_said_where_objects_join_the_parts_or_nothing_jumps():
    assert doubt_torn(*torn(), np.zeros(0)) == []
    both, times, seen = torn()
    seen[-1] = seen[0]  # one object of before is seen after it
    assert doubt_torn(both, times, seen, np.array([9.0])) == []
    # All boxes are of one side.
    assert doubt_torn(*torn(), np.array([30.0])) == []


def test_nothing_is_said_of_other_places():
    elsewhere = np.random.default_rng(4).uniform(-2, 2, (8, 3))
    assert doubt_torn(*torn(elsewhere), np.array([9.0])) == []
    others = [f"other {name}" for name in CLASSES]
    assert doubt_torn(*torn(classes_after=others), np.array([9.0])) == []


def boxes_across(ids_after, shift=2.0, seconds_after=10.0):
    """Return 4 boxes in each of the images at 9 s and at 10 s, and the times of poses."""
    before = np.array([[100.0 * i, 50.0, 100.0 * i + 40.0, 90.0] for i in range(4)])
    after = before + [shift, 0.0, shift, 0.0]
    boxes = dq.Detections(
        pose=np.repeat([9, 10], 4),
        box=np.vstack([before, after]),
        score=np.ones(8),
        class_id=np.zeros(8, dtype=np.int64),
        object_id=np.array([100, 101, 102, 103, *ids_after]),
        class_names={0: "cup"},
    )
    return boxes, np.array([*range(10), *np.arange(seconds_after, seconds_after + 10)], dtype=float)


def told(*across):
    few = landmarks(np.random.default_rng(5).uniform(-2, 2, (8, 3)), ["cup"] * 8)
    return doubt_jumps(few, *across, np.array([9.0]))


def test_boxes_that_go_on_but_are_of_other_objects_are_told():
    [doubt] = told(*boxes_across([104, 105, 102, 107]))
    assert "jumps at 9 s, and 3 of 4 boxes that hardly move" in doubt
    # Most of them are of the same objects as before.
    assert told(*boxes_across([104, 101, 102, 103])) == []
    # The intersection over union of boxes of 40 px that move by 20 is a third.
    assert told(*boxes_across([104, 105, 106, 107], shift=20.0)) == []
    # Four intervals later, boxes that overlap may be of other things.
    assert told(*boxes_across([104, 105, 106, 107], seconds_after=13.0)) == []


@pytest.mark.parametrize("gap", [0, 8])
def test_a_run_over_a_gap_in_which_the_odometry_got_lost(tmp_path, gap):
    """Either the objects join both parts, or the report doubts the map."""
    recording = dq.simulate(dq.load_scenario("orbit"), seed=4)[0]
    relative = recording.odometry.relative.copy()
    relative[JUMP] = _core.compose(_core.PoseModel.SE3, relative[JUMP : JUMP + 1], OFFSET[None])[0]
    lost = replace(recording, odometry=replace(recording.odometry, relative=relative))
    dq.io.save_recording(lost, tmp_path / "recording")
    odometry = tmp_path / "recording" / "odometry.txt"
    lines = odometry.read_text().splitlines(keepends=True)
    odometry.write_text("".join(lines[: JUMP - gap + 1] + lines[JUMP + gap + 1 :]))
    files = [tmp_path / "recording" / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    result = run_files(*files, RunFilesOptions(ids="none"))
    doubts = [doubt for doubt in result.report["doubts"] if "the odometry jumps" in doubt]
    count = len(result.estimate.object_ids)
    assert (count == 8 and doubts == []) or (count > 8 and len(doubts) == 1)
