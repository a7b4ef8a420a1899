"""CSV of other programs: pandas, supervision, Ultralytics."""

import numpy as np
import pytest

from dqslam.io import FileError, InputWarning, Notes, frame_rate, read_detections

HZ = frame_rate(10)


def read(tmp_path, text, **more):
    path = tmp_path / "boxes.csv"
    path.write_text(text)
    return read_detections(path, **{"width": 640, "height": 480, **more})


def test_the_table_of_a_detector_in_pandas(tmp_path):
    text = ",xmin,ymin,xmax,ymax,confidence,class,name,frame\n0,10,20,30.5,50,0.25,7,cup,3\n"
    table = read(tmp_path, text, frames=HZ)
    # Its pixels count from the corner of the image, ours from the center of the first one.
    np.testing.assert_array_equal(table.box, [[9.5, 19.5, 30, 49.5]])
    assert (table.frame[0], table.timestamp[0], table.score[0]) == (3, 0.3, 0.25)
    assert (table.class_id[0], table.class_name[0]) == (7, "cup")


def test_the_table_of_supervision(tmp_path):
    text = (
        "x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,frame_index,class_name\n"
        "10.0,20.0,30.0,50.0,7,0.5,,0,cup\n12.0,20.0,32.0,50.0,7,0.75,4,2,cup\n"
    )
    table = read(tmp_path, text, frames=HZ)
    np.testing.assert_array_equal(table.box[1], [11.5, 19.5, 31.5, 49.5])
    assert table.track_id.tolist() == [-1, 4]
    assert table.timestamp.tolist() == [0, 0.2]


def test_left_top_width_height(tmp_path):
    text = "frame,id,bb_left,bb_top,bb_width,bb_height,conf\n0,9,10,20,30,40,0.5\n"
    table = read(tmp_path, text, frames=HZ)
    np.testing.assert_array_equal(table.box, [[9.5, 19.5, 39.5, 59.5]])
    assert table.track_id.tolist() == [9]


def test_our_own_names_count_from_the_center_of_the_first_pixel(tmp_path):
    table = read(tmp_path, "timestamp;x1;y1;x2;y2\n0.5;10;20;30;50\n")
    np.testing.assert_array_equal(table.box, [[10, 20, 30, 50]])


def test_images_by_name(tmp_path):
    text = "filename,width,height,class,xmin,ymin,xmax,ymax\nb/7.png,640,480,cup,1,2,3,4\n"
    table = read(tmp_path, text, frames=HZ)
    assert (table.frame[0], table.timestamp[0], table.class_name[0]) == (7, 0.7, "cup")
    np.testing.assert_array_equal(table.box, [[0.5, 1.5, 2.5, 3.5]])
    with pytest.raises(FileError, match="its images have 320 x 480 px, those of the camera 640 x"):
        read(tmp_path, text.replace("640", "320"), frames=HZ)
    timed = text.replace("b/7.png", "1311868164.25.png")
    assert read(tmp_path, timed).timestamp[0] == 1311868164.25


def test_an_id_beside_a_track_id_is_the_number_of_the_row(tmp_path):
    for header in ("timestamp,id,track_id,x1,y1,x2,y2", "timestamp,track_id,id,x1,y1,x2,y2"):
        cells = ["0", "5", "6", "1", "2", "3", "4"]
        expected = int(cells[header.split(",").index("track_id")])
        table = read(tmp_path, f"{header}\n{','.join(cells)}\n")
        assert table.track_id.tolist() == [expected]


def test_columns_that_mean_nothing_here_are_noted(tmp_path):
    with pytest.warns(InputWarning, match="boxes.csv: not used: mask area"):
        read(tmp_path, "timestamp,mask area,x1,y1,x2,y2\n0,1,1,2,3,4\n")


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            "timestamp,x1,y1,x2,y2,score,confidence",
            "columns score and confidence are both the score",
        ),
        ("x1,y1,x2,y2,score,class,area", r":1: no column frame, timestamp or image \(it has: x1"),
        ("timestamp,x,y,x2,y2,a,b", r":1: no column x1, y1"),
    ],
)
def test_contradicting_and_missing_columns(tmp_path, header, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, f"{header}\n0,1,2,3,4,0.5,0.5\n")


def test_times_since_1970_in_a_smaller_unit(tmp_path):
    notes = Notes()
    text = "timestamp,x1,y1,x2,y2\n1403636579763555584,1,2,3,4\n1403636579813555584,1,2,3,4\n"
    table = read(tmp_path, text, notes=notes)
    np.testing.assert_allclose(
        table.timestamp, [1403636579.763555584, 1403636579.813555584], rtol=0, atol=3e-7
    )
    assert "nanoseconds since 1970" in notes.sentences()[0]


def test_a_wide_header_takes_no_time_that_grows_with_its_square(tmp_path):
    names = [f"c{i}" for i in range(20000)]
    text = ",".join(["timestamp", "x1", "y1", "x2", "y2", *names])
    table = read(tmp_path, f"{text}\n0,1,2,3,4{',0' * len(names)}\n", notes=Notes())
    assert len(table.columns) == 20005


def test_a_frame_has_one_image(tmp_path):
    text = "frame,image,x1,y1,x2,y2\n0,left/1.png,1,2,3,4\n0,{},1,2,3,4\n"
    assert read(tmp_path, text.format("left/1.png"), frames=HZ).frame.tolist() == [0, 0]
    with pytest.raises(FileError, match=r":3: two images are frame 0: left/1.png and right/1.png"):
        read(tmp_path, text.format("right/1.png"), frames=HZ)


def test_names_that_contradict_those_asked_for_are_noted(tmp_path):
    text = "timestamp,x1,y1,x2,y2,class,name\n0,1,2,3,4,5,cup\n"
    notes = Notes()
    table = read(tmp_path, text, classes={5: "jar"}, notes=notes)
    assert table.class_name == ("jar",)
    assert "class 5 is cup here, and is called jar as asked for" in notes.sentences()[0]
