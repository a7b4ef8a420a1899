"""Files with more than a class and a score of each box: other classes, and what it looks like."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import Detections
from dqslam.io import FileError, read_detections
from dqslam.io.convert import convert
from dqslam.recording import Detections as Boxes

HEADER = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id"
ROWS = [
    "# a comment is no row",
    "0,0.0,10,10,60,60,0.9,4,cup,-1",
    "1,0.1,10,10,60,60,0.2,4,cup,-1",
    "2,0.2,12,10,62,60,0.7,7,bowl,-1",
]


def write(folder, rows=ROWS, header=HEADER, name="boxes.csv"):
    path = folder / name
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def read(path, **more):
    return read_detections(path, width=640, height=480, **more)


def other_columns(cells, columns="class_id_2,class_name_2,score_2"):
    rows = [f"{row},{cell}" for row, cell in zip(ROWS[1:], cells, strict=True)]
    return rows, f"{HEADER},{columns}"


def test_vectors_beside_a_table_belong_to_its_rows(tmp_path):
    vectors = np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0], [0.5, 0.5, 0.5]])
    path = write(tmp_path)
    np.save(tmp_path / "boxes.npy", vectors.astype(np.float32))
    table = read(path)
    np.testing.assert_array_equal(table.embedding, vectors)
    np.testing.assert_array_equal(
        table.select(np.array([False, True, True])).embedding, vectors[1:]
    )
    (tmp_path / "boxes.npy").unlink()
    assert read(path).embedding is None


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.ones((4, 2)), r"boxes.npy: its shape is \(4, 2\), but .*boxes.csv has 3 boxes"),
        (np.ones(3), r"boxes.npy: holds float64 of shape \(3,\), not a vector"),
        (np.ones((3, 2), dtype=complex), "holds complex128"),
        ([[1, 0], [0, 1], [np.nan, 1]], r"boxes.npy: row 2 is not finite .*boxes.csv:5\)"),
        ([[1, 0], [0, np.inf], [0, 1]], "row 1 is not finite"),
        ([[1, 0], [0, 0], [0, 1]], r"row 1 is all zero: it has no direction .*boxes.csv:4\)"),
    ],
)
def test_vectors_that_do_not_fit_are_refused_with_file_and_row(tmp_path, array, message):
    np.save(tmp_path / "boxes.npy", array)
    with pytest.raises(FileError, match=message):
        read(write(tmp_path))


def test_a_file_of_vectors_that_is_none_is_refused(tmp_path):
    (tmp_path / "boxes.npy").write_text("1,2,3")
    with pytest.raises(FileError, match="boxes.npy: is no array of NumPy"):
        read(write(tmp_path))


def test_other_classes_have_the_numbers_of_the_first_ones(tmp_path):
    rows, header = other_columns(["7,bowl,0.05", ",,", "9,plate,0.3"])
    table = read(write(tmp_path, rows, header))
    np.testing.assert_array_equal(table.class_id, [4, 4, 7])
    np.testing.assert_array_equal(table.others.class_id, [[7], [-1], [9]])
    np.testing.assert_array_equal(table.others.score, [[0.05], [0.0], [0.3]])
    assert table.others.class_names == {7: "bowl", 9: "plate"}


def test_names_alone_are_looked_up_in_the_first_classes(tmp_path):
    rows, header = other_columns(["bowl,0.05", ",", "cup,0.3"], "class_name_2,score_2")
    table = read(write(tmp_path, rows, header))
    np.testing.assert_array_equal(table.others.class_id, [[7], [-1], [4]])


@pytest.mark.parametrize(
    ("cells", "columns", "message"),
    [
        (["7,bowl,1.5"] + [",,"] * 2, None, "boxes.csv:2: score_2 is 1.5, not between 0 and 1"),
        ([",,", "7,bowl,", ",,"], None, "boxes.csv:3: score_2 is empty"),
        ([",,", "4,cup,0.1", ",,"], None, "boxes.csv:3: class 2 is that of the box again, cup"),
        (["7", "", ""], "class_id_2", "boxes.csv:1: class 2 needs a column score_2"),
        (["0.1", "", ""], "score_3", "boxes.csv:1: score_3 needs a column class_id_3"),
    ],
)
def test_other_classes_that_do_not_fit_are_refused(tmp_path, cells, columns, message):
    rows, header = other_columns(cells, columns or "class_id_2,class_name_2,score_2")
    with pytest.raises(FileError, match=message):
        read(write(tmp_path, rows, header))


def test_both_survive_a_conversion_and_other_formats_report_their_loss(tmp_path):
    rows, header = other_columns(["7,bowl,0.05", ",,", "9,plate,0.3"])
    source = write(tmp_path, rows, header)
    np.save(tmp_path / "boxes.npy", np.eye(3))
    (written,) = convert(source, tmp_path / "again.csv")
    assert written.loses == ()
    again = read(tmp_path / "again.csv")
    np.testing.assert_array_equal(again.embedding, np.eye(3))
    np.testing.assert_array_equal(again.others.class_id, [[7], [-1], [9]])
    written, *_ = convert(source, tmp_path / "mot.txt", to="mot")
    assert written.loses[-2:] == ("other classes of boxes", "what boxes look like")
    with pytest.raises(FileError, match="is an input, which would be written over"):
        convert(source, tmp_path / "boxes.csv.gz")


def test_a_recording_keeps_both_with_the_rows_of_its_boxes(tmp_path):
    simulated, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    boxes = simulated.detections
    count = len(boxes)
    vectors = np.random.default_rng(0).normal(size=(count, 5)).astype(np.float32)
    boxes = dq.Detections(
        boxes.pose,
        boxes.box,
        boxes.score,
        boxes.class_id,
        boxes.object_id,
        boxes.class_names | {77: "box"},
        other_class_id=np.where(np.arange(count) % 2, 77, -1)[:, None],
        other_score=np.full((count, 1), 0.25),
        embedding=vectors,
    )
    dq.io.save_recording(replace(simulated, detections=boxes), tmp_path / "drive")
    files = [tmp_path / "drive" / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    loaded, _ = dq.load_recording(*files, min_score=0.0)
    order = np.lexsort((boxes.object_id, boxes.pose))
    np.testing.assert_array_equal(loaded.detections.embedding, vectors[order])
    np.testing.assert_array_equal(loaded.detections.other_class_id, boxes.other_class_id[order])
    assert loaded.detections.class_names[77] == "box"


def made(**more):
    return Boxes.from_xyxy(0, [[0, 0, 9, 9], [20, 0, 29, 9]], class_id=[0, 1], **more)


def test_arrays_of_detections_are_checked_by_row():
    two = made(other_class_id=[[1], [-1]], other_score=[[0.2], [0.0]], embedding=np.eye(2))
    assert isinstance(two, Detections)
    assert two.select(np.array([1])).embedding.tolist() == [[0.0, 1.0]]
    assert made().embedding.shape == (2, 0)
    for more, message in (
        ({"embedding": np.eye(3)}, r"detections.embedding: expected shape \(2, e\), got \(3, 3\)"),
        ({"embedding": [[1, 0], [0, 0]]}, "embedding row 1: all zero: it has no direction"),
        ({"embedding": [[1, 0], [0, np.nan]]}, "embedding row 1: not finite$"),
        ({"other_class_id": [[1], [1]]}, "other_class_id row 1: the class of the box again"),
        ({"other_class_id": [1, 0]}, r"other_class_id: expected shape \(2, k\), got \(2,\)"),
        ({"other_class_id": [[1], [0]]}, r"other_score: expected shape \(2, 1\), got \(0, 0\)"),
        (
            {"other_class_id": [[1], [0]], "other_score": [[0.1], [-0.1]]},
            "other_score row 1: negative",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            made(**more)


def test_a_session_needs_vectors_of_one_length():
    slam = dq.OnlineSlam(dq.Camera(500.0, 500.0, 320.0, 240.0, 640, 480), trust_ids=0.9)
    box, motion = [[10.0, 10.0, 60.0, 60.0]], dq.Motion([0.1, 0, 0, 0, 0, 0, 1], 1e-4 * np.eye(6))
    slam.add(None, dq.StepBoxes(box, [-1], embedding=[[1.0, 2.0]]))
    with pytest.raises(dq.StepError, match="step 1: embedding: 3 numbers a box, and 2 before"):
        slam.add(motion, dq.StepBoxes(box, [-1], embedding=[[1.0, 2.0, 3.0]]))
    with pytest.raises(dq.StepError, match="step 1: embedding row 0: all zero"):
        slam.add(motion, dq.StepBoxes(box, [-1], embedding=[[0.0, 0.0]]))
    slam.add(motion, dq.StepBoxes(box, [-1], embedding=[[1.0, 2.0]]))
