"""``dqslam locate`` and ``dqslam changes`` on files."""

import csv
import json

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main
from dqslam.places.changes.files import read_changes, write_changes
from orbit import CAMERA
from small_place import CENTERS, NAMES, boxes_at, pose_at, write_map

POSES = [pose_at(1.3, -2.2, 0.9), pose_at(-2.0, 1.0, 1.3)]


@pytest.fixture
def files(tmp_path):
    """Write a map, a camera, and boxes of two images and of one that shows too little."""
    write_map(tmp_path / "map")
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    lines = ["timestamp,x1,y1,x2,y2,score,class_id,class_name"]
    kinds = sorted(set(NAMES))
    for time, pose in enumerate([*POSES, POSES[0]]):
        for row, box in enumerate(boxes_at(pose)[: 2 if time == 2 else None]):
            edges = ",".join(f"{x:.6f}" for x in box)
            lines.append(f"{time},{edges},0.9,{kinds.index(NAMES[row])},{NAMES[row]}")
    (tmp_path / "boxes.csv").write_text("\n".join(lines) + "\n")
    return tmp_path


def arguments(files, *more):
    names = {"--camera": "camera.json", "--detections": "boxes.csv"}
    given = [part for key, name in names.items() for part in (key, str(files / name))]
    return ["locate", str(files / "map"), *given, *map(str, more)]


def test_locate_writes_a_row_for_each_image(files, capsys):
    assert main(arguments(files, "--out", files / "out", "--json")) == 0
    printed = json.loads(capsys.readouterr().out)
    with (files / "out" / "locations.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["timestamp"]) for row in rows] == [0.0, 1.0, 2.0]
    for row, pose in zip(rows, POSES, strict=False):
        found = [float(row[name]) for name in ("x", "y", "z")]
        np.testing.assert_allclose(found, pose[:3], atol=1e-3)
        assert float(row["confidence"]) > 0.99
    assert rows[2]["x"] == ""
    assert rows[2]["reason"].startswith("too few: 2 of 2 boxes")
    assert [one["found"] for one in printed["images"]] == [True, True, False]
    assert np.shape(printed["images"][0]["candidates"][0]["covariance"]) == (6, 6)
    assert (files / "out" / "locations.png").stat().st_size > 10_000


def test_locate_reads_other_classes_of_boxes(files, capsys):
    """The first class of each box is the next one of the list, the second one is right."""
    kinds = sorted(set(NAMES))
    lines = ["timestamp,x1,y1,x2,y2,score,class_name,class_name_2,score_2"]
    for name, box in zip(NAMES, boxes_at(POSES[0]), strict=True):
        wrong = kinds[(kinds.index(name) + 1) % len(kinds)]
        lines.append(f"0,{','.join(f'{x:.6f}' for x in box)},0.5,{wrong},{name},0.45")
    (files / "boxes.csv").write_text("\n".join(lines) + "\n")
    assert main(arguments(files, "--json")) == 0
    image = json.loads(capsys.readouterr().out)["images"][0]
    assert image["found"]
    np.testing.assert_allclose(image["candidates"][0]["pose"][:3], POSES[0][:3], atol=5e-3)


def test_locate_prints_why_there_is_no_answer(files, capsys):
    assert main(arguments(files)) == 0
    text = capsys.readouterr().out
    assert "2 of 3 located" in text
    assert "too few" in text


def test_locate_refuses_what_is_no_map(files, capsys):
    (files / "map" / "map.json").write_text('{"objects": []}')
    assert main(arguments(files)) == 2
    assert "map.json: has no ellipsoid" in capsys.readouterr().err


def test_changes_writes_a_table_and_a_figure(files, capsys):
    centers = CENTERS.copy()
    centers[3] += [0.4, -0.3, 0.0]
    after = write_map(files / "after", centers)
    out = files / "changes"
    assert main(["changes", str(files / "map"), str(after), "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    with (out / "changes.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows].count("stayed") == len(NAMES) - 1
    assert rows[3]["status"] == "moved"
    assert float(rows[3]["distance"]) == pytest.approx(0.5, abs=0.02)
    assert printed["objects"][3]["second_center"] == pytest.approx(centers[3].tolist())
    assert (out / "changes.png").stat().st_size > 10_000
    assert main(["plot", str(out), "--kind", "png"]) == 0
    # The file has all that the figure needs.
    figure = (out / "figures" / "changes.png").read_bytes()
    assert figure == (out / "changes.png").read_bytes()


def test_changes_that_are_read_are_those_that_were_written(files):
    centers = CENTERS.copy()
    centers[3] += [0.4, -0.3, 0.0]
    found = dq.changes(files / "map", write_map(files / "after", centers))
    write_changes(files, found)
    read = read_changes(files / "changes.json")
    assert [one.status for one in read.objects] == [one.status for one in found.objects]
    np.testing.assert_array_equal(read.second_from_first, found.second_from_first)
    np.testing.assert_array_equal(read.cameras, found.cameras)
    for one, other in zip(read.objects, found.objects, strict=True):
        for name, value in vars(one).items():
            expected = getattr(other, name)
            assert (value is None) == (expected is None)
            if isinstance(value, str):
                assert value == expected
            elif value is not None:
                np.testing.assert_allclose(value, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("status", "gone", "status is 'gone', not one of stayed"),
        ("size", -1.0, "size is -1 m, not positive"),
        ("first_center", [0.0, 1.0], "first_center: expected shape"),
        ("first_id", None, "has one of first_id and first_center without the other"),
        ("looks", None, "objects row 2: "),
    ],
)
def test_wrong_changes_are_refused_with_their_row(files, capsys, key, value, said):
    write_changes(files, dq.changes(files / "map", files / "map"))
    path = files / "changes.json"
    content = json.loads(path.read_text())
    content["objects"][2][key] = value
    path.write_text(json.dumps(content))
    assert main(["plot", str(files)]) == 2
    printed = capsys.readouterr().err
    assert "changes.json: objects row 2: " in printed
    assert said in printed
    assert not (files / "figures").exists()


def test_changes_refuses_a_file_without_a_motion(files, capsys):
    path = files / "alignment.json"
    path.write_text("{}")
    folder = str(files / "map")
    assert main(["changes", folder, folder, "--b-from-a", str(path)]) == 2
    assert "alignment.json: has no b_from_a" in capsys.readouterr().err
