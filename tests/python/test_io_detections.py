import numpy as np
import pytest

from dqslam.io import FileError, read_detections

HEADER = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id"
GOOD = "0,0.5,10,20,30,50,0.9,3,cup,7"


def read(tmp_path, *lines):
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_detections(path, width=640, height=480)


def test_columns_are_found_by_name(tmp_path):
    table = read(
        tmp_path,
        "# by hand",
        "extra,track_id,class_name,class_id,score,y2,x2,y1,x1,timestamp,frame",
        'moved,7,"cup, blue",3,0.25,50,30,20,10,0.5,4',
    )
    assert (table.frame[0], table.timestamp[0], table.score[0]) == (4, 0.5, 0.25)
    np.testing.assert_array_equal(table.box, [[10, 20, 30, 50]])
    assert (table.class_id[0], table.class_name[0], table.track_id[0]) == (3, "cup, blue", 7)
    assert table.line[0] == 3


def test_empty_score_is_one_and_empty_id_is_none(tmp_path):
    table = read(tmp_path, HEADER, "0,0,1,1,2,2,,3,cup,", "1,1,1,1,2,2, ,3,cup,-1")
    np.testing.assert_array_equal(table.score, [1, 1])
    np.testing.assert_array_equal(table.track_id, [-1, -1])


def test_a_file_without_track_ids(tmp_path):
    table = read(tmp_path, HEADER.replace("track_id", "derived_track_id"), GOOD)
    assert table.track_id is None
    assert table.columns[-1] == "derived_track_id"


def test_boxes_are_cut_to_the_image(tmp_path):
    table = read(
        tmp_path, HEADER, "0,0,-9,-8,650,481,1,3,cup,7", "0,0,-0.5,0,639.5,479.5,1,3,cup,8"
    )
    np.testing.assert_array_equal(table.box, [[-0.5, -0.5, 639.5, 479.5], [-0.5, 0, 639.5, 479.5]])


def test_rows_may_come_in_any_order(tmp_path):
    table = read(tmp_path, HEADER, "5,2.5,1,1,2,2,1,3,cup,7", "4,2,1,1,2,2,1,3,cup,7")
    np.testing.assert_array_equal(table.timestamp, [2.5, 2])


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("0,0.5,nan,20,30,50,0.9,3,cup,7", r"boxes\.csv:3: x1 is not a finite number below"),
        ("0,0.5,10,20,inf,50,0.9,3,cup,7", r":3: x2 is not a finite number below"),
        ("0,nan,10,20,30,50,0.9,3,cup,7", r":3: timestamp is not a finite"),
        ("0,0.5,10,20,30,50,nan,3,cup,7", r":3: score is not a finite"),
        ("0,0.5,10,20,30,50,1.5,3,cup,7", r":3: score is 1\.5, not between 0 and 1"),
        ("0,0.5,10,20,30,50,-1,3,cup,7", r":3: score is -1, not between"),
        ("0,0.5,ten,20,30,50,0.9,3,cup,7", r":3: x1 is 'ten', not a number"),
        ("0,0.5,,20,30,50,0.9,3,cup,7", r":3: x1 is not a finite number below"),
        ("0,0.5,30,20,10,50,0.9,3,cup,7", r":3: inverted box 30, 20, 10, 50"),
        ("0,0.5,10,20,30,20,0.9,3,cup,7", r":3: empty box 10, 20, 30, 20"),
        ("0,0.5,640,20,700,50,0.9,3,cup,7", r":3: box 640.* is outside the image of 640 x 480"),
        ("0,0.5,10,-50,30,-0.5,0.9,3,cup,7", r":3: box 10.* is outside the image"),
        ("0,0.5,10,20,30,50,0.9,3,cup", r":3: 9 fields, but 10 columns"),
        ("0,0.5,10,20,30,50,0.9,3,a,cup,7", r":3: 11 fields, but 10 columns"),
        ("0,0.5,10,20,30,50,0.9,3.5,cup,7", r":3: class_id is 3\.5, not a whole number"),
        ("0,0.5,10,20,30,50,0.9,3,cup,1e+300", r":3: track_id is 1e\+300, not a whole"),
        ("0,0.6,10,20,30,50,0.9,3,cup,7", r":3: frame 0 has two times, 0\.5 and 0\.6 \(line 2\)"),
        ("1,0.4,10,20,30,50,0.9,3,cup,7", r":3: frame 1 at 0\.4 s is not later than frame 0 at"),
        ("1,0.5,10,20,30,50,0.9,3,cup,7", r":3: frame 1 at 0\.5 s is not later than frame 0 at"),
        ('0,0.5,10,20,30,50,0.9,3,"cup,7', r"boxes\.csv: not CSV"),
    ],
)
def test_bad_rows_are_named(tmp_path, row, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, HEADER, GOOD, row)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([""], r"boxes\.csv: is empty"),
        (["# only"], r"boxes\.csv: holds nothing but comments"),
        ([HEADER], r"boxes\.csv: holds no rows, only a header"),
        (
            [GOOD],
            r"boxes\.csv:1: no column frame, timestamp or image, x1, y1, x2, y2 \(it has: 0, 0\.5",
        ),
        (["# c", HEADER.replace("x2", "east"), GOOD], r":2: no column x2 \(it has: frame"),
        ([HEADER.replace("y2", "y1"), GOOD], r":1: 2 columns are named y1"),
        ([HEADER + ",xmin", GOOD + ",1"], r":1: columns x1 and xmin are both the x1"),
        ([HEADER + ",x1", GOOD + ",1"], r":1: 2 columns are named x1"),
    ],
)
def test_bad_files(tmp_path, lines, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, *lines)


def test_missing_file(tmp_path):
    with pytest.raises(FileError, match=r"none\.csv: no such file"):
        read_detections(tmp_path / "none.csv", width=640, height=480)
