"""Boxes in JSON: variants of COCO, OA-SLAM, supervision, JSON lines."""

import json

import numpy as np
import pytest

from dqslam.io import FileError, Notes, frame_rate, read_detections

SIZE = {"width": 640, "height": 480}
HZ = frame_rate(10)
ENTRY = {"image_id": 4, "category_id": 3, "bbox": [10, 20, 30, 40]}
ONE = '[{"image_id": 7, "category_id": 8, "bbox": [%s]}]'
BOX = [9.5, 19.5, 39.5, 59.5]


def read(tmp_path, content, name="boxes.json", **more):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_detections(path, **{**SIZE, "frames": HZ, **more})


def dataset(*images, **more):
    annotations = [ENTRY | {"image_id": image["id"]} for image in images]
    return {"images": list(images), "annotations": annotations, **more}


@pytest.mark.parametrize("key", ["confidence", "conf", "score"])
def test_a_score_by_any_name(tmp_path, key):
    assert read(tmp_path, [ENTRY | {key: 0.125}]).score[0] == 0.125


def test_two_scores_are_refused_and_unknown_keys_noted(tmp_path):
    with pytest.raises(FileError, match="columns score and confidence are both the score"):
        read(tmp_path, [ENTRY | {"score": 0.5, "confidence": 0.25}])
    notes = Notes()
    read(tmp_path, [ENTRY | {"difficult": 1, "area": 5, "iscrowd": 0, "id": 9}], notes=notes)
    assert [text.split(": ", 1)[1] for text in notes.sentences()] == ["not used: difficult"]


def test_names_of_files_tell_the_frame_where_ids_are_arbitrary(tmp_path):
    images = [{"id": 71, "file_name": "a_3.jpg"}, {"id": 5, "file_name": "a_4.jpg"}]
    notes = Notes()
    table = read(tmp_path, dataset(*images), notes=notes)
    assert table.frame.tolist() == [3, 4]
    assert "number in file_name, which differs from image_id" in notes.sentences()[0]


def test_ids_are_frames_where_no_name_tells_one(tmp_path):
    images = [{"id": 7, "file_name": "one.jpg"}, {"id": 9, "file_name": "other.jpg"}]
    notes = Notes()
    assert read(tmp_path, dataset(*images), notes=notes).frame.tolist() == [7, 9]
    assert "image_id is the frame, as no file_name tells it" in notes.sentences()[0]


def test_images_of_a_video_have_their_frame(tmp_path):
    images = [{"id": 71, "file_name": "b.jpg", "frame_id": 6, "video_id": 1}]
    assert read(tmp_path, dataset(*images)).frame.tolist() == [6]
    images.append({"id": 72, "file_name": "b.jpg", "frame_id": 6, "video_id": 2})
    with pytest.raises(FileError, match="its images are of 2 videos, not of one"):
        read(tmp_path, dataset(*images))


def test_two_images_of_one_frame_are_refused(tmp_path):
    entries = [ENTRY | {"image_id": name} for name in ("left/4.png", "right/4.png")]
    with pytest.raises(FileError, match="two images are frame 4: left/4.png and right/4.png"):
        read(tmp_path, entries)
    images = [{"id": 1, "file_name": "left/4.png"}, {"id": 2, "file_name": "right/4.png"}]
    with pytest.raises(FileError, match="two images are frame 4"):
        read(tmp_path, dataset(*images))


def test_images_of_another_size_than_the_camera_are_refused(tmp_path):
    image = {"id": 1, "file_name": "1.png", "width": 320, "height": 240}
    with pytest.raises(FileError, match="its images have 320 x 240 px, those of the camera 640 x"):
        read(tmp_path, dataset(image))
    assert len(read(tmp_path, dataset(image | {"width": 640, "height": 480}))) == 1


def test_the_list_at_the_top_counts(tmp_path):
    inner = {"annotations": [ENTRY | {"image_id": 1}]}
    table = read(tmp_path, {"info": inner, "annotations": [ENTRY], "images": []})
    assert table.frame.tolist() == [4]
    text = json.dumps(inner)[:-1] + "," + json.dumps({"annotations": [ENTRY]})[1:]
    with pytest.raises(FileError, match="has two lists annotations"):
        read(tmp_path, text)


def test_boxes_of_corners_and_of_crowds(tmp_path):
    corners = ENTRY | {"bbox": [10, 20, 40, 60], "bbox_mode": 0}
    np.testing.assert_array_equal(read(tmp_path, [corners]).box[0], BOX)
    with pytest.raises(FileError, match="bbox_mode is 4, not 0"):
        read(tmp_path, [corners | {"bbox_mode": 4}])
    notes = Notes()
    table = read(tmp_path, [ENTRY, ENTRY | {"iscrowd": 1}], notes=notes)
    assert (len(table), notes.left_out[0].count) == (1, 1)


@pytest.mark.parametrize(
    "segmentation",
    [
        [[10, 20, 40, 20, 40, 60]],
        [[10, 20, 12, 20, 12, 22], [30, 30, 40, 60, 30, 60]],
        # Columns of 480 pixels: 10 are empty, then 30 with 40 pixels from row 20.
        {"size": [480, 640], "counts": [4820, 40, *[440, 40] * 29, 420 + 480 * 600]},
    ],
)
def test_boxes_around_segmentations(tmp_path, segmentation):
    entry = {key: value for key, value in ENTRY.items() if key != "bbox"}
    table = read(tmp_path, [entry | {"segmentation": segmentation}])
    np.testing.assert_array_equal(table.box[0], BOX)


def test_packed_run_lengths(tmp_path):
    """Runs 6, 1, 40, 4, 49: the 4th is 3 more than the 2nd, the last 9 more than the 3rd."""
    entry = {"image_id": 0, "category_id": 3}
    counts = "61X139"
    mask = {"size": [10, 10], "counts": counts}
    table = read(tmp_path, [entry | {"segmentation": mask}])
    # Pixel 6 is row 6 of column 0, pixels 47 to 50 end column 4 and begin column 5.
    np.testing.assert_array_equal(table.box[0], [-0.5, -0.5, 5.5, 9.5])
    with pytest.raises(FileError, match="counts that are no run lengths of its size"):
        read(tmp_path, [entry | {"segmentation": mask | {"size": [10, 11]}}])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ONE % "1, 2, 3, 1e400", "y2 is not a finite number below"),
        (ONE % ("1, 2, 3, 1" + "0" * 400), "y2 is not a finite number below"),
        (ONE % ("1, 2, 3, 1" + "0" * 5000), "read as coco"),
        (ONE % "1, 2, Infinity, 4", "x2 is not"),
        ('{"annotations": ' + "[" * 100000, "nested too deeply|not JSON"),
        ('[{"a": ' + "[" * 100000, "nested too deeply|not JSON"),
        (ONE.replace("7", "true") % "1, 2, 3, 4", "image_id is True, not a"),
        (ONE.replace("8", "[1]") % "1, 2, 3, 4", r"category_id is \[1\], not"),
        ("[]\n[]", r"boxes\.json:2: not JSON: text after its end"),
    ],
)
def test_readers_cannot_be_killed(tmp_path, text, message):
    with pytest.raises(FileError, match=message) as error:
        read(tmp_path, text)
    assert len(str(error.value)) < 1500


def test_oaslam_by_hand(tmp_path):
    boxes = [{"category_id": 41, "detection_score": 0.25, "bbox": [10, 20, 40, 60]}]
    images = [{"file_name": f"rgb/{i}.png", "detections": boxes * i} for i in range(3)]
    table = read(tmp_path, images)
    assert table.frame.tolist() == [1, 2, 2]
    np.testing.assert_array_equal(table.box[0], BOX)
    assert (table.score[0], table.class_id[0]) == (0.25, 41)
    timed = [{"file_name": "rgb/1.25.png", "detections": boxes}]
    assert read(tmp_path, timed, frames=None).timestamp.tolist() == [1.25]


def test_supervision_by_hand(tmp_path):
    row = {"x_min": "10.0", "y_min": 20, "x_max": 40.0, "y_max": 60, "class_id": 3}
    row |= {"confidence": "0.5", "tracker_id": "", "frame_index": 7, "class_name": "cup"}
    table = read(tmp_path, [row])
    np.testing.assert_array_equal(table.box[0], BOX)
    assert (table.frame[0], table.score[0], table.class_name[0]) == (7, 0.5, "cup")
    assert table.track_id.tolist() == [-1]


def test_a_nested_box(tmp_path):
    box = {"x1": 10, "y1": 20, "x2": 40, "y2": 60}
    row = {"name": "cup", "class": 3, "confidence": 0.5, "box": box, "timestamp": 2.5}
    table = read(tmp_path, [row], frames=None)
    np.testing.assert_array_equal(table.box[0], BOX)
    assert (table.class_id[0], table.class_name[0], table.timestamp[0]) == (3, "cup", 2.5)


def test_json_lines(tmp_path):
    lines = [{"timestamp": i / 2, "x1": 10, "y1": 20, "x2": 40, "y2": 60} for i in range(2)]
    text = "\n".join(map(json.dumps, lines))
    table = read(tmp_path, text, "boxes.jsonl", frames=None)
    np.testing.assert_array_equal(table.box, [[10, 20, 40, 60]] * 2)
    assert (table.timestamp.tolist(), table.line.tolist()) == ([0, 0.5], [1, 2])
    coco = "\n".join(json.dumps(ENTRY | {"image_id": i}) for i in range(2))
    table = read(tmp_path, coco, "boxes.txt")
    np.testing.assert_array_equal(table.box, [BOX] * 2)
    assert table.frame.tolist() == [0, 1]
    with pytest.raises(FileError, match=r"boxes\.jsonl:2: not JSON"):
        read(tmp_path, text[:-1], "boxes.jsonl")


@pytest.mark.parametrize("key", ["frame", "frame_id", "file_name"])
def test_entries_without_an_image_id(tmp_path, key):
    entry = {name: value for name, value in ENTRY.items() if name != "image_id"}
    value = "rgb/6.png" if key == "file_name" else 6
    table = read(tmp_path, [entry | {key: value}])
    assert table.frame.tolist() == [6]
    with pytest.raises(FileError, match="missing image_id"):
        read(tmp_path, [entry])


def test_lines_of_images_with_their_boxes(tmp_path):
    box = {"x1": 10, "y1": 20, "x2": 40, "y2": 60, "label": "cup"}
    lines = [{"frame": i, "timestamp": i / 2, "detections": [box] * i} for i in range(3)]
    table = read(tmp_path, "\n".join(map(json.dumps, lines)), "boxes.jsonl", frames=None)
    assert table.frame.tolist() == [1, 2, 2]
    assert table.timestamp.tolist() == [0.5, 1, 1]
    assert table.line.tolist() == [2, 3, 3]
    assert table.class_name == ("cup",) * 3
    lines[0]["detections"] = [[10, 20, 40, 60]]
    with pytest.raises(FileError, match=r":1: entry 0: detections is no list of tables"):
        read(tmp_path, "\n".join(map(json.dumps, lines)), "boxes.jsonl", frames=None)
    lines[0]["detections"] = [{"bbox": [10, 20, 40, 60]}]
    with pytest.raises(FileError, match="bbox is a list: are these corners or sizes. name them"):
        read(tmp_path, "\n".join(map(json.dumps, lines)), "boxes.jsonl", frames=None)
