"""Maps that are torn where the odometry jumps."""

import re
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.pipeline import run_files
from dqslam.pipeline.jumps import doubt_torn
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


def test_a_run_over_a_gap_in_which_the_odometry_got_lost(tmp_path):
    """Either the objects join both parts, or the report doubts the map."""
    recording = dq.simulate(dq.load_scenario("orbit"), seed=4)[0]
    relative = recording.odometry.relative.copy()
    relative[JUMP] = _core.compose(_core.PoseModel.SE3, relative[JUMP : JUMP + 1], OFFSET[None])[0]
    lost = replace(recording, odometry=replace(recording.odometry, relative=relative))
    dq.io.save_recording(lost, tmp_path / "recording")
    odometry = tmp_path / "recording" / "odometry.txt"
    lines = odometry.read_text().splitlines(keepends=True)
    odometry.write_text("".join(lines[: JUMP - 8] + lines[JUMP + 8 :]))
    files = [tmp_path / "recording" / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    result = run_files(*files, RunFilesOptions(ids="none"))
    told = [doubt for doubt in result.report["doubts"] if "in the map twice" in doubt]
    assert (len(result.estimate.object_ids), len(told)) in {(8, 0), (16, 1)}
    assert told == [] or float(re.search(r"(\S+) m away", told[0])[1]) == pytest.approx(1, abs=0.2)
