"""Bad records are left out and counted up to a share, and beyond it they refuse the file."""

import numpy as np
import pytest

from dqslam.io import FileError, InputWarning, Notes, read_detections, read_trajectory

HEADER = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name\n"
SIZE = {"width": 640, "height": 480}


def boxes(tmp_path, *bad, count=100):
    rows = [f"{i},{i / 10},{i},20,{i + 50},90,0.9,0,cup" for i in range(count)]
    for place, row in enumerate(bad):
        rows[10 + place] = row
    path = tmp_path / "boxes.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("10,1.0,50,20,50,90,0.9,0,cup", r"boxes\.csv:12: empty box 50, 20, 50, 90"),
        ("10,1.0,700,20,750,90,0.9,0,cup", r":12: box 700, 20, 750, 90 is outside the image"),
        ("10,1.0,,20,50,90,0.9,0,cup", r":12: x1 is not a finite number below"),
        ("10,1.0,5,20,50,90,7,0,cup", r":12: score is 7, not between 0 and 1"),
    ],
)
def test_one_bad_box_of_a_hundred_is_left_out_and_counted(tmp_path, row, message):
    path, notes = boxes(tmp_path, row), Notes()
    table = read_detections(path, **SIZE, notes=notes)
    assert len(table) == 99
    assert 10 not in table.frame
    (left,) = notes.left_out
    assert (left.what, left.count, left.of) == ("boxes", 1, 100)
    with pytest.warns(InputWarning, match=f"1 of 100 boxes left out: .*{message}"):
        read_detections(path, **SIZE)
    with pytest.raises(FileError, match=message):
        read_detections(path, **SIZE, notes=Notes(max_bad=0))


def test_more_than_a_twentieth_refuses_the_file(tmp_path):
    rows = [f"{10 + i},{1 + i / 10},50,20,50,90,0.9,0,cup" for i in range(6)]
    notes = Notes()
    assert len(read_detections(boxes(tmp_path, *rows[:5]), **SIZE, notes=notes)) == 95
    with pytest.raises(FileError, match=r"\(6 of 100 boxes are bad, 5% may be\)"):
        read_detections(boxes(tmp_path, *rows), **SIZE)
    assert len(read_detections(boxes(tmp_path, *rows), **SIZE, notes=Notes(max_bad=0.06))) == 94


def test_boxes_below_the_least_score_do_not_count(tmp_path):
    rows = [f"{10 + i},{1 + i / 10},50,20,50,90,0.1,0,cup" for i in range(20)]
    notes = Notes()
    table = read_detections(boxes(tmp_path, *rows), **SIZE, min_score=0.5, notes=notes)
    assert (len(table), notes.left_out) == (100, [])
    with pytest.raises(FileError, match=r":12: empty box"):
        read_detections(boxes(tmp_path, *rows), **SIZE)


def poses(tmp_path, *rows, count=40):
    lines = [f"{i} {i} 0 0 0 0 0 1" for i in range(count)]
    for place, row in enumerate(rows):
        lines[10 + place] = row
    path = tmp_path / "path.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("10 nan nan nan nan nan nan nan", r"path\.txt:11: tx is not a finite number below"),
        ("10 1 1 1 0 0 0 0", r":11: quaternion has length 0"),
        ("9 9 0 0 0 0 0 1", r":11: time 9\.0 repeats 9\.0 \(line 10\)"),
    ],
)
def test_a_lost_pose_and_a_repeated_one_are_left_out(tmp_path, row, message):
    notes = Notes()
    times, found = read_trajectory(poses(tmp_path, row), notes=notes)
    np.testing.assert_array_equal(times, np.delete(np.arange(40.0), 10))
    np.testing.assert_array_equal(found[:, 0], times)
    (sentence,) = notes.sentences()
    assert "1 of 40 poses left out" in sentence
    with pytest.raises(FileError, match=message):
        read_trajectory(poses(tmp_path, row), notes=Notes(max_bad=0))


def test_another_pose_at_the_same_time_is_a_contradiction(tmp_path):
    with pytest.raises(FileError, match=r":11: time 9\.0 repeats 9\.0 \(line 10\)"):
        read_trajectory(poses(tmp_path, "9 5 0 0 0 0 0 1"))


def test_the_share_is_a_share():
    with pytest.raises(ValueError, match="max_bad is 2, not between 0 and 1"):
        Notes(max_bad=2)
