import pytest

from dqslam.io import FileError, FormatNames, choose_frame_times, split_formats
from dqslam.io.frames import BY_NUMBER

TUM, KITTI = "0 1 2 3 0 0 0 1\n", "1 0 0 0 0 1 0 0 0 0 1 0\n"
CSV = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name\n"
MOT = "1,-1,10,20,30,40,0.9,-1,-1,-1\n"


def test_names_are_sorted_by_kind():
    assert split_formats([]) == FormatNames(None, None, None)
    assert split_formats(["mot", "ros", "kitti"]) == FormatNames("ros", "kitti", "mot")
    assert split_formats(["rosbag"]) == FormatNames("rosbag", "rosbag", "rosbag")
    assert split_formats(["rosbag", "json"]) == FormatNames("json", "rosbag", "rosbag")


def test_unknown_and_double_names():
    known = (
        "rosbag, .*json, toml, .*ros, colmap, kitti-calib, .*tum, kitti, .*, yolo, .*, coco, mot, "
        "kitti-tracking, csv"
    )
    with pytest.raises(ValueError, match=f"format 'bvh' is none of {known}"):
        split_formats(["tum", "bvh"])
    with pytest.raises(ValueError, match="formats tum and kitti are both of trajectory"):
        split_formats(["tum", "kitti"])


@pytest.mark.parametrize(
    ("path", "boxes", "expected"),
    [(KITTI, CSV, BY_NUMBER), (KITTI, MOT, BY_NUMBER), (TUM, CSV, None), (TUM, MOT, None)],
)
def test_frames_count_where_the_trajectory_has_no_times(tmp_path, path, boxes, expected):
    files = (tmp_path / "path.txt", tmp_path / "boxes.txt")
    for file, text in zip(files, (path, boxes), strict=True):
        file.write_text(text)
    assert choose_frame_times(*files) is expected


def test_files_in_no_known_format_say_what_was_tried(tmp_path):
    path = tmp_path / "path.dat"
    path.write_text("1 2 3\n")
    with pytest.raises(FileError, match=r"trajectory in no known format \(.*tum: 8 fields a line"):
        choose_frame_times(path, path)
    with pytest.raises(FileError, match=r"no such file"):
        choose_frame_times(tmp_path / "none", path)
