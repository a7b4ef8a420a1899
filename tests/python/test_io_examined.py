"""What the check before a run is shown: boxes as they are in the file, not cut to the image."""

import csv

import numpy as np
import pytest

from dqslam import io
from dqslam.cli import main
from orbit import make_orbit, write_orbit


def rewritten(path, change):
    """Change each row of a CSV of boxes."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(map(change, rows))


@pytest.fixture
def files(tmp_path):
    return write_orbit(tmp_path, make_orbit(12))


def examined(files, **options):
    """Return the boxes that are examined, and the recording."""
    seen = []
    recording, _ = io.load_recording(
        *files, examine=lambda camera, trajectory, table: seen.append(table), **options
    )
    return seen[0], recording


def test_boxes_are_examined_uncut_and_used_cut(files):
    rewritten(files[2], lambda row: row | {"y2": "700"} if row["frame"] == "3" else row)
    table, recording = examined(files)
    third = table.frame == 3
    assert np.all(table.box[third, 3] == 700.0)
    assert np.all(recording.detections.box[recording.detections.pose == 3, 3] == 479.5)


def test_boxes_below_the_least_score_are_not_examined(files):
    """What takes no part says nothing about the files, wherever it is."""
    far = {"score": "0.2", "x1": "900", "x2": "990"}
    rewritten(files[2], lambda row: row | far if row["class_id"] == "1" else row)
    table, recording = examined(files, min_score=0.5)
    assert len(table) == len(recording.detections) == 36
    assert table.box[:, 2].max() < 640.0
    table, _ = examined(files, min_score=0.0, notes=io.Notes(max_bad=0.5))
    assert len(table) == 48


def test_a_box_outside_the_image_is_left_out_and_counted_after_that(files):
    out = {"x1": "900", "x2": "990"}
    rewritten(
        files[2], lambda row: row | out if (row["frame"], row["class_id"]) == ("0", "1") else row
    )
    notes = io.Notes()
    table, recording = examined(files, notes=notes)
    assert (len(table), len(recording.detections)) == (48, 47)
    (sentence,) = notes.sentences()
    assert (
        "1 of 48 boxes left out" in sentence and "is outside the image of 640 x 480 px" in sentence
    )


@pytest.mark.parametrize(("bar", "size"), [(80.0, "640x640"), (160.0, "640x800")])
def test_boxes_below_a_bar_stop_a_run_with_the_option_that_mends_them(tmp_path, capsys, bar, size):
    """Bars above and below, as a detector takes a square or an upright image."""
    folder = tmp_path / "recording"
    assert main(["simulate", "orbit", "--seed", "4", "--out", str(folder), "-q"]) == 0
    rewritten(
        folder / "boxes.csv",
        lambda row: row | {name: str(float(row[name]) + bar) for name in ("y1", "y2")},
    )
    command = ["run", "--ids", "none", "--out", str(tmp_path / "out"), "--quiet"]
    for kind, name in (("camera", "camera.json"), ("odometry", "odometry.txt")):
        command += [f"--{kind}", str(folder / name)]
    command += ["--detections", str(folder / "boxes.csv")]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert "image size: " in said
    if size == "640x640":
        assert "--box-image 640x640 --letterbox" in said
    assert main([*command, "--box-image", size, "--letterbox"]) == 0
