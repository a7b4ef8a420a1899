"""Names that steer terminals, pages or formulas are shown, and steer nothing."""

import csv
import json
import os
import shutil
import subprocess
import sys

import pytest

from dqslam._repr import printable, printable_json
from dqslam.cli import main
from dqslam.cli.output import Output

CLEAR = "\x1b[2J\x1b]0;owned\x07"
NAMES = (
    f"cup{CLEAR}",
    "cup\x9b31m",
    r"$\frac$",
    "a$b</script><script>alert(1)</script>",
    "[bold]cup[/bold][link=http://a]b[/link]",
    "_cup",
    "cup\ndqslam: all is well",
    "茶\u202egpj.exe",
)


def test_by_hand():
    assert printable("a\x1b[1m\tb\n\x9b\u202e茶") == r"a\x1b[1m\x09b\x0a\x9b\u202e茶"
    assert printable("a\nb\x07", keep="\n") == "a\nb\\x07"
    text = json.dumps({"name": "a\x7f\x9b\u202e茶"}, ensure_ascii=False)
    assert json.loads(printable_json(text)) == json.loads(text)
    assert printable_json(text) == '{"name": "a\\u007f\\u009b\\u202e茶"}'


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "rec"
    assert main(["simulate", "orbit", "--seed", "1", "--out", str(folder), "-q"]) == 0
    assert main(["run", "--config", str(folder / "run.toml"), "-q"]) == 0
    return folder


def is_plain(text):
    return printable(text, keep="\n") == text


def recording_of(folder):
    files = {"camera": "camera.json", "odometry": "odometry.txt", "detections": "boxes.csv"}
    return [word for key, name in files.items() for word in (f"--{key}", str(folder / name))]


@pytest.fixture
def renamed(results, tmp_path):
    """Return a recording with results, each of whose objects has one of the names."""
    folder = shutil.copytree(results, tmp_path / "rec")
    (folder / "results" / "manifest.json").unlink()
    path = folder / "results" / "map.json"
    content = json.loads(path.read_text())
    assert len(content["objects"]) == len(NAMES)
    for one, name in zip(content["objects"], NAMES, strict=True):
        one["class_name"] = name
    path.write_text(json.dumps(content))
    for path in (folder / "results" / "boxes.csv", folder / "boxes.csv"):
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        for number, row in enumerate(rows):
            place = int(row.get("object_id", row.get("track_id", number))) % len(NAMES)
            row |= {"class_name": NAMES[place].replace("\n", " "), "class_id": place}
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    return folder


def test_nothing_that_is_said_steers_a_terminal(renamed, capsys, tmp_path):
    given, page = recording_of(renamed), tmp_path / "page"
    truth = ["--groundtruth", str(renamed / "groundtruth.txt")]
    truth += ["--objects", str(renamed / "objects.csv")]
    for command in (
        ["inspect", *given],
        ["inspect", *given, "--json"],
        ["run", *given, "--out", str(tmp_path / "again")],
        ["run", *given, "--out", str(tmp_path / "again"), "--json"],
        ["evaluate", str(renamed / "results"), *truth],
        ["plot", str(renamed / "results")],
        ["view", str(renamed / "results"), "--export", str(page)],
    ):
        assert main(command) == 0, command
        said = capsys.readouterr()
        assert is_plain(said.out), command
        assert said.err == "", command
    for name in NAMES:
        assert name not in (page / "index.html").read_text()  # but in a script of its own
    script = (page / "scene.js").read_text()
    scene = json.loads(script.removeprefix("const scene = ").rstrip().removesuffix(";"))
    assert {one["className"] for one in scene["objects"]} == set(NAMES)


def test_names_of_files_are_shown(capsys, tmp_path):
    assert main(["plot", str(tmp_path / f"no{CLEAR}")]) == 2
    said = capsys.readouterr().err
    assert is_plain(said)
    assert r"no\x1b[2J\x1b]0;owned\x07: no such directory" in said
    Output().warn(f"a{CLEAR}")
    Output().line(f"a{CLEAR}")
    Output().document({"name": f"a\x9b{CLEAR}"})
    assert is_plain(capsys.readouterr().out)


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"], ["--version"]])
def test_a_reader_that_goes_early_is_no_error(command):
    """As in `dqslam --help | head -1`."""
    code = "import sys; from dqslam.cli import main; sys.exit(main())"
    read, write = os.pipe()
    os.close(read)
    process = subprocess.run(
        [sys.executable, "-c", code, *command], stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert (process.returncode, process.stderr) == (141, "")
