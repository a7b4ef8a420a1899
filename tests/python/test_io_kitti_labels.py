"""Labels of KITTI's tracking and object benchmarks."""

import numpy as np
import pytest

from dqslam.io import FileError, Notes, frame_rate, read_detections

HZ = frame_rate(10)
LABEL = "0 0 -1.57 100.5 50 200 150.25 1.5 1.6 3.9 1 1.5 20 -1.5"


def read(path, **more):
    return read_detections(path, **{"width": 1242, "height": 375, "frames": HZ, **more})


@pytest.mark.parametrize(("end", "score"), [("", 1), (" 0.75", 0.75)])
def test_tracking(tmp_path, end, score):
    path = tmp_path / "0005.txt"
    rows = [f"0 3 Car {LABEL}{end}", f"0 -1 DontCare {LABEL}{end}", f"2 4 Van {LABEL}{end}"]
    path.write_text("\n".join(rows) + "\n")
    notes = Notes()
    table = read(path, notes=notes)
    np.testing.assert_array_equal(table.box, [[100.5, 50, 200, 150.25]] * 2)
    assert (table.frame.tolist(), table.timestamp.tolist()) == ([0, 2], [0, 0.2])
    assert (table.track_id.tolist(), table.class_name) == ([3, 4], ("Car", "Van"))
    assert (table.score.tolist(), table.line.tolist()) == ([score, score], [1, 3])
    assert notes.left_out[0].reason == "regions DontCare"
    assert not notes.has_bad  # they are no mistake


def test_objects(tmp_path):
    for number, text in enumerate([f"Car {LABEL}\n", "", f"Van {LABEL}\nCar {LABEL}\n"]):
        (tmp_path / f"{number:06d}.txt").write_text(text)
    table = read(tmp_path)
    assert table.frame.tolist() == [0, 2, 2]
    assert table.class_name == ("Car", "Van", "Car")
    assert table.class_id.tolist() == [0, 1, 0]
    assert table.track_id is None
    assert table.files[2].endswith("000002.txt")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([f"0 3 Car {LABEL}", "0 3 Car 1 2"], r"a\.txt:2: 5 fields, not 17 or 18"),
        ([f"0 3 Car {LABEL}", f"x 3 Car {LABEL}"], r":2: frame is 'x', not a number"),
        ([f"0 3 DontCare {LABEL}"], r"a\.txt: holds no boxes"),
    ],
)
def test_bad_labels_are_named(tmp_path, rows, message):
    (tmp_path / "a.txt").write_text("\n".join(rows) + "\n")
    with pytest.raises(FileError, match=message):
        read(tmp_path / "a.txt", format="kitti-tracking")


def test_times_are_asked_for(tmp_path):
    (tmp_path / "a.txt").write_text(f"0 3 Car {LABEL}\n")
    with pytest.raises(FileError, match="kitti has no times: give them with --frame-times FILE"):
        read(tmp_path / "a.txt", frames=None)
