import json
from pathlib import Path

import pytest

import planted
from console import assert_one_line_of_error
from dqslam.cli import main


@pytest.fixture
def files(tmp_path):
    return planted.write_planted(tmp_path, drift=0.3)


def call(files, *more):
    return main(
        ["evaluate", str(files.results), "--groundtruth", str(files.groundtruth), *map(str, more)]
    )


def test_tables_and_file(files, capsys):
    assert call(files, "--objects", files.objects, "--boxes", files.boxes) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    written = json.loads((files.results / "evaluation.json").read_text())
    assert list(written) == [
        "align",
        "poses",
        "ate",
        "odometry_ate",
        "rpe",
        "odometry_rpe",
        "nees",
        "true_from_estimated",
        "objects",
        "reprojection_iou",
        "association",
        "tracks",
    ]
    assert written["objects"]["matched"] == 3
    text = " ".join(shown.out.split())
    assert f"odometry: position, m {written['odometry_ate']['rmse']:.4f}" in text
    assert "3 matched, 2 missed, 1 invented, by distance and class; 1 in the map move" in text
    assert "5 found, 1 missed, 0 split, 0 invented" in text
    assert "recall 1" in text


def keys(content):
    """Yield all keys, at any depth."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield key
            yield from keys(value)
    elif isinstance(content, list):
        for value in content:
            yield from keys(value)


def test_the_documentation_has_every_key(files):
    options = ("--objects", files.objects, "--boxes", files.boxes, "--align", "sim3")
    assert call(files, *options) == 0
    written = json.loads((files.results / "evaluation.json").read_text())
    page = (Path(__file__).parents[2] / "docs" / "evaluation.md").read_text()
    table = page[page.index("## `evaluation.json`") :]
    assert {key for key in keys(written) if f"`{key}`" not in table} == set()


def test_json_is_the_file(files, capsys):
    assert call(files, "--json", "--rpe-delta", 0.5, "--rpe-unit", "meters") == 0
    shown = capsys.readouterr()
    assert shown.out == (files.results / "evaluation.json").read_text()
    content = json.loads(shown.out)
    assert content["objects"] is None
    assert content["association"] is None
    assert (content["rpe"]["delta"], content["rpe"]["unit"]) == (0.5, "meters")


def test_without_boxes_it_says_so(files, capsys):
    (files.results / "boxes.csv").unlink()
    assert call(files, "--match", "id", "--objects", files.objects) == 0
    shown = capsys.readouterr().out
    assert "unknown: there is no boxes.csv" in shown
    assert "1 invented, by id;" in " ".join(shown.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--objects", "none.csv"), "none.csv: no such file"),
        (("--boxes", "none.csv"), "none.csv: no such file"),
        (("--groundtruth", "none.txt"), "none.txt: no such file"),
        (("--align", "affine"), "'--align'"),
        (("--rpe-delta", "0"), "delta: expected a positive number, got 0"),
        (("--rpe-delta", "100"), "no two poses are 100 frames apart"),
        (("--gate", "-1"), "--gate: -1 is not positive"),
        (("--max-time-difference", "-1"), "--max-time-difference: -1 is negative"),
    ],
)
def test_bad_arguments_are_one_line_and_code_2(files, capsys, arguments, message):
    assert call(files, *arguments) == 2
    assert_one_line_of_error(capsys, message)
    assert not (files.results / "evaluation.json").exists()


def test_missing_results_are_named(files, capsys):
    (files.results / "map.json").unlink()
    assert call(files) == 2
    assert "map.json: no such file" in capsys.readouterr().err
    assert main(["evaluate", "nowhere", "--groundtruth", str(files.groundtruth)]) == 2
    assert "nowhere: no such directory" in capsys.readouterr().err


def test_groundtruth_is_needed(files, capsys):
    assert main(["evaluate", str(files.results)]) == 2
    assert "--groundtruth" in capsys.readouterr().err


def test_its_options_stand_beside_it_and_give_it_again(files, capsys):
    assert call(files, "--objects", files.objects, "--align", "sim3", "--quiet") == 0
    assert capsys.readouterr() == ("", "")
    path = files.results / "evaluation.json"
    first = path.read_bytes()
    path.unlink()
    options = path.with_suffix(".toml")
    assert main(["evaluate", "--config", str(options), "--json"]) == 0
    assert path.read_bytes() == first
    assert capsys.readouterr().out == first.decode()
    assert main(["evaluate", "--config", str(options), "--align", "none", "--quiet"]) == 0
    assert json.loads(path.read_text())["align"] == "none"
