import json

import numpy as np
import pytest

import realdata
from dqslam.io import (
    DETECTION_FORMATS,
    FileError,
    InputWarning,
    frame_rate,
    read_class_names,
    read_detections,
    read_frame_times,
)

FORMATS = {format_.name: format_ for format_ in DETECTION_FORMATS}
SIZE = {"width": 640, "height": 480}
HZ = frame_rate(10)
ENTRY = {"image_id": 4, "category_id": 3, "bbox": [10, 20, 30, 40], "score": 0.5}
CSV = """frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id
0,0.5,449.24,314.81,501.57,377.39,0.9841,1,ape,1
0,0.5,-7.3,0,114.79,144.68,0.17,3,"tea, cup",-1
7,1311868164.363181,0.1,0.2,639.000001,479.5,1,1,ape,2
"""


def write(tmp_path, name, content):
    text = content if isinstance(content, str) else json.dumps(content, indent=1)
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return path


def read(path, **more):
    return read_detections(path, **{**SIZE, "frames": HZ, **more})


def test_coco_by_hand(tmp_path):
    table = read(write(tmp_path, "boxes.json", [ENTRY, ENTRY | {"image_id": 5}]))
    # COCO's first pixel spans 0 to 1, ours -0.5 to 0.5.
    np.testing.assert_array_equal(table.box[0], [9.5, 19.5, 39.5, 59.5])
    np.testing.assert_array_equal(table.timestamp, [0.4, 0.5])
    assert (table.score[0], table.class_id[0], table.class_name[0]) == (0.5, 3, "3")
    assert table.track_id is None
    assert table.line.tolist() == [2, 13]


def test_a_coco_box_of_the_whole_image(tmp_path):
    table = read(write(tmp_path, "a.json", [ENTRY | {"bbox": [0, 0, 640, 480]}]))
    np.testing.assert_array_equal(table.box[0], [-0.5, -0.5, 639.5, 479.5])


def test_a_coco_dataset_names_classes_and_images(tmp_path):
    dataset = {
        "images": [{"id": 40, "file_name": "rgb/1.500.png"}],
        "categories": [{"id": 3, "name": "cup"}],
        "annotations": [ENTRY | {"image_id": 40}],
    }
    path = write(tmp_path, "a.json", dataset)
    table = read(path, frames=None)  # the name is a time
    assert (table.class_name[0], table.frame[0], table.timestamp[0]) == ("cup", 0, 1.5)
    with pytest.warns(InputWarning, match="names of images are times: a rate of 10 Hz is not used"):
        assert read(path).timestamp[0] == 1.5
    times = read_frame_times(write(tmp_path, "rgb.txt", "1.4 rgb/1.400.png\n1.5 rgb/1.500.png\n"))
    table = read(path, frames=times)
    assert (table.frame[0], table.timestamp[0]) == (1, 1.5)
    named = write(tmp_path, "b.json", [ENTRY | {"image_id": "1.400"}])
    assert read(named, frames=times).timestamp[0] == 1.4
    assert read(path, frames=None, classes=read_class_names(path)).class_name == ("cup",)
    assert read(path, frames=None, classes={3: "mug"}).class_name == ("mug",)


def test_yolo_by_hand(tmp_path):
    write(tmp_path, "labels/000002.txt", "3 0.5 0.5 0.25 0.5\n0 0.1 0.1 0.1 0.1 0.75 12\n")
    write(tmp_path, "labels/000005.txt", "3 0.5 0.5 1 1 0.5\n")
    write(tmp_path, "labels/000006.txt", "")
    write(tmp_path, "labels/classes.txt", "person\n\n\ncup\n")
    table = read(tmp_path / "labels")
    # Center 320, 240 from the corner of the image, 160 x 240 px.
    np.testing.assert_array_equal(table.box[0], [239.5, 119.5, 399.5, 359.5])
    np.testing.assert_array_equal(table.box[2], [-0.5, -0.5, 639.5, 479.5])
    assert (table.frame.tolist(), table.line.tolist()) == ([2, 2, 5], [1, 2, 1])
    assert table.timestamp.tolist() == [0.2, 0.2, 0.5]
    assert table.score.tolist() == [1, 0.75, 0.5]
    assert table.track_id.tolist() == [-1, 12, -1]
    assert table.class_name == ("cup", "person", "cup")
    assert table.files[2].endswith("000005.txt")


@pytest.mark.parametrize("names", ["names: [cup, jar]\n", "nc: 2\nnames:\n  0: cup\n  1: jar\n"])
def test_yolo_names_in_data_yaml(tmp_path, names):
    write(tmp_path, "labels/left_1.txt", "1 0.5 0.5 0.25 0.5\n")
    data = write(tmp_path, "labels/data.yaml", names)
    assert read(tmp_path / "labels").class_name == ("jar",)
    assert read_class_names(data) == {0: "cup", 1: "jar"}


@pytest.mark.parametrize(
    ("line", "score", "class_id", "name", "track"),
    [
        ("1,-1,1,1,640,480,0.5,-1,-1,-1", 0.5, 0, "object", -1),
        ("1,7,1,1,640,480,0.5,3,0.8", 0.5, 3, "3", 7),
        ("1,7,1,1,640,480", 1, 0, "object", 7),
        ("1 7 1 1 640 480 0.5", 0.5, 0, "object", 7),
        ("1, 7, 1, 1, 640, 480, 0.5, 2", 0.5, 2, "2", 7),
        ("1,7,1,1,640,480,0.5,2,-1,-1", 0.5, 2, "2", 7),
        ("1,7,1,1,640,480,0.5,1.5,-2.5,12.1", 0.5, 0, "object", 7),
        ("1,7,1,1,640,480,-1", 1, 0, "object", 7),
    ],
)
def test_mot_by_hand(tmp_path, line, score, class_id, name, track):
    table = read(write(tmp_path, "det.txt", line + "\n" + "3" + line[1:]))
    np.testing.assert_array_equal(table.box[0], [0, 0, 639.5, 479.5])  # cut: it ends at 640
    assert table.frame.tolist() == [0, 2]
    assert table.timestamp.tolist() == [0, 0.2]
    assert (table.score[0], table.class_id[0], table.class_name[0]) == (score, class_id, name)
    assert table.track_id[0] == track


def test_times_of_frames_go_before_those_of_the_file(tmp_path):
    table = read(write(tmp_path, "a.csv", CSV))
    assert table.timestamp.tolist() == [0, 0, 0.7]
    assert read(write(tmp_path, "a.csv", CSV), frames=None).timestamp[2] == 1311868164.363181


@pytest.mark.parametrize("other", ["csv", "coco", "yolo", "mot"])
def test_csv_comes_back_to_the_digit(tmp_path, other):
    """What a format has no place for is put back from the first table."""
    first = read(write(tmp_path, "a.csv", CSV), frames=None, cut=False)
    there = tmp_path / ("there" + {"coco": ".json", "csv": ".csv"}.get(other, ""))
    FORMATS[other].write(there, first, **(SIZE if other == "yolo" else {}))
    frames = None
    if other == "mot":
        write(tmp_path, "times.csv", "frame,timestamp\n0,0.5\n7,1311868164.363181\n")
        frames = read_frame_times(tmp_path / "times.csv")
    classes = {1: "ape", 3: "tea, cup"} if other == "mot" else None
    again = read(there, frames=frames, cut=False, classes=classes)
    if other == "yolo":  # a file an image: in the order of frames
        assert again.frame.tolist() == sorted(first.frame.tolist())
    FORMATS["csv"].write(tmp_path / "back.csv", again)
    assert (tmp_path / "back.csv").read_text() == CSV


@pytest.mark.parametrize("name", ["coco", "mot", "yolo"])
def test_the_others_come_back_to_the_digit(tmp_path, name):
    first, back = tmp_path / "first", tmp_path / "back"
    table = read(write(tmp_path, "a.csv", CSV), frames=None, cut=False)
    more = SIZE if name == "yolo" else {}
    FORMATS[name].write(first, table, **more)
    table = read(first, format=name, frames=HZ if name == "mot" else None, cut=False)
    FORMATS["csv"].write(tmp_path / "there.csv", table)
    FORMATS[name].write(back, read(tmp_path / "there.csv", frames=None, cut=False), **more)
    if name != "yolo":
        assert back.read_text() == first.read_text()
        return
    files = sorted(path.name for path in first.iterdir())
    assert files == ["000000.txt", "000007.txt", "classes.txt", "frames.csv"]
    # CSV has a millionth of a pixel.
    for file in files[:2]:
        cells = [np.loadtxt(folder / file, ndmin=2) for folder in (first, back)]
        np.testing.assert_allclose(cells[1], cells[0], rtol=0, atol=1e-9)
    for file in files[2:]:
        assert (back / file).read_text() == (first / file).read_text()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.json", [ENTRY, ENTRY | {"bbox": [1, 2, 0, 4]}], r"a\.json:13: empty box 0\.5, 1\.5"),
        ("a.json", [ENTRY | {"bbox": [1, 2, -3, 4]}], r":2: inverted box"),
        ("a.json", [ENTRY | {"bbox": [1, 2, 3]}], r":2: entry 0: bbox is not a list of 4 numbers"),
        ("a.json", [ENTRY | {"bbox": [1, 2, 3, "a"]}], r"entry 0: bbox is 'a', not a number"),
        (
            "a.json",
            [ENTRY | {"bbox": [1, 2, 3, float("nan")]}],
            r"a\.json:2: y2 is not a finite number below",
        ),
        ("a.json", [ENTRY | {"score": 2}], r"a\.json:2: score is 2, not between 0 and 1"),
        ("a.json", [ENTRY | {"category_id": 1.5}], r":2: class_id is 1\.5, not a whole number"),
        ("a.json", [ENTRY, {"image_id": 4}], r"entry 1: missing bbox \(it has: image_id"),
        (
            "a.json",
            [ENTRY | {"image_id": "shot"}],
            r"a\.json:2: its name is no number of a frame; --frame-times",
        ),
        ("a.json", [ENTRY, 3], r"entry 1 is no table of named values"),
        ("a.json", '[{"image_id": 4},\n {"image_id": }]', r"a\.json:2: not JSON"),
        ("a.json", '[{"image_id": 4}\n {"image_id": 5}]', r"a\.json:2: not JSON: expected ','"),
        ("a.json", '[{"image_id": 4}', r"not JSON"),
        ("a.json", "[]", r"a\.json: holds no boxes"),
        ("a.json", {"images": []}, r"no list annotations \(it has: images\)"),
        ("a.json", "3", r"neither a list nor a table"),
        ("a.json", {"annotations": [ENTRY], "categories": [3]}, r"categories is no list of \{id"),
        ("a.txt", "1,-1,1,2,3,4,0.5\n1,-1,1,2,3\n", r"a\.txt:2: 5 fields, not 6 to 10 alike"),
        ("a.txt", "1,-1,1,2,3,4,32.5", r":1: score is 32\.5, not between"),
        ("a.txt", "1,-1,1,2,-3,4,0.5", r":1: inverted box 0, 1, -3, 5"),
        ("a.txt", "1,-1,1,2,3,4,0.5\nx,-1,1,2,3,4,0.5", r":2: frame is 'x', not a number"),
        ("a.txt", "1,-1,1,2,3,nan,0.5", r":1: y2 is not a finite number below"),
        ("a.txt", "1,-1,900,2,3,4,0.5", r":1: box 899, 1, 902, 5 is outside the image of 640"),
        ("a/7.txt", "1 0.5 0.5 0.1\n", r"a/7\.txt:1: 4 fields, not 5 to 7"),
        (
            "a/7.txt",
            "1 0.5 0.5 0.1 0.1\n1 0.5 0.5 nan 0.1\n",
            r"a/7\.txt:2: x1 is not a finite number below",
        ),
        ("a/7.txt", "1 0.5 0.5 0.1 -0.1\n", r"a/7\.txt:1: inverted box"),
        ("a/7.txt", "1 0.5 0.5 big 0.1\n", r"a/7\.txt:1: a number is 'big', not a number"),
        ("a/shot.txt", "1 0.5 0.5 0.1 0.1\n", r"a/shot\.txt:1: its name is no number of a frame"),
        ("a/7.txt", "", r"a: holds no boxes"),
    ],
)
def test_bad_files_name_file_and_line(tmp_path, name, text, message):
    path = write(tmp_path, name, text)
    with pytest.raises(FileError, match=message):
        read(path if path.parent == tmp_path else path.parent)


def test_what_cannot_be_told_is_asked_for(tmp_path):
    write(tmp_path, "a/7.txt", "1 0.5 0.5 0.1 0.1\n")
    with pytest.raises(FileError, match="give its size with --camera"):
        read_detections(tmp_path / "a", frames=HZ)
    files = {"yolo": tmp_path / "a", "coco": write(tmp_path, "a.json", [ENTRY])}
    files["mot"] = write(tmp_path, "a.txt", "1,-1,1,2,3,4,0.5\n")
    for name, path in files.items():
        with pytest.raises(
            FileError, match=f"{name} has no times: .*--frame-times FILE or --frame"
        ):
            read(path, frames=None)
    with pytest.raises(
        ValueError, match="'tum' is none of detections formats: rosbag, kitti-objects"
    ):
        read(files["mot"], format="tum")


def test_many_inverted_boxes_are_another_format(tmp_path):
    rows = [f"{i},{i},{100 + i},{100 + i},50,20,1,1,cup" for i in range(9)]
    path = write(tmp_path, "a.csv", "\n".join([CSV.split(",track_id")[0], *rows]))
    with pytest.raises(
        FileError,
        match=r":2: inverted box .*x, y, width, height\? \(9 of 9 boxes are bad, 5% may be",
    ):
        read(path)


def test_a_folder_is_written_whole_or_not_at_all(tmp_path):
    table = read(write(tmp_path, "a.csv", CSV), frames=None, cut=False)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("keep")
    with pytest.raises(FileError, match="mine: is there already, and not empty"):
        FORMATS["yolo"].write(tmp_path / "mine", table, **SIZE)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "mine"]
    assert (tmp_path / "mine" / "notes").read_text() == "keep"


@pytest.mark.parametrize("name", ["csv", "coco", "mot", "yolo"])
@pytest.mark.parametrize(
    "recording",
    [
        "bop_lmo/seg_0703_1001/detections_fasterrcnn.csv",
        "kitti_tracking/0005/tracks_yolox_ocsort.csv",
        "tum_fr3_cabinet/detections_yolo.csv",
    ],
)
def test_real_boxes_come_back(tmp_path, recording, name):
    folder, _, file = recording.partition("/")
    table = read_detections(realdata.recording(folder) / file)
    FORMATS[name].write(tmp_path / "there", table, **(SIZE if name == "yolo" else {}))
    write_times = {"frames": None} if name != "mot" else {"frames": frame_rate(1)}
    again = read(tmp_path / "there", format=name, cut=False, **write_times)
    order = np.argsort(table.frame, kind="stable")
    if name != "yolo":
        order = np.arange(len(table))
    np.testing.assert_allclose(again.box, table.box[order], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(again.score, table.score[order])
    np.testing.assert_array_equal(again.frame, table.frame[order])
    np.testing.assert_array_equal(again.class_id, table.class_id[order])
    tracks = np.full(len(table), -1) if again.track_id is None else again.track_id
    np.testing.assert_array_equal(tracks, table.track_id[order])
