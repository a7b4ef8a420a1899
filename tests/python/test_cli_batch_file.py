"""The file of a batch: which recordings there are, their options, and what is wrong in it."""

from pathlib import Path

import pytest

from dqslam._files import FileErrors
from dqslam.cli.batch_file import load_batch
from dqslam.studies.batch import AlignOptions, MergeOptions

TOP = """\
[defaults]
camera = "camera.json"
odometry = "odometry.txt"
detections = "boxes.csv"
ids = "none"
"""


@pytest.fixture
def load(tmp_path):
    for name in ("drives/a/left", "drives/b/left", "drives/b/right", "table"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "one.mcap").write_text("")

    def load(text):
        (tmp_path / "fleet.toml").write_text(text)
        return load_batch(tmp_path / "fleet.toml")

    return load


def test_recordings_have_names_and_their_own_options(load, tmp_path):
    batch = load(
        TOP
        + """
[[recordings]]
folder = "drives/*/left"

[[recordings]]
folder = "table"
name = "kitchen"
ids = "class_id"
hold_out = 0.2

[[recordings]]
bag = "*.mcap"
topics = ["/odom"]
""".replace("topics", "topic")
    )
    assert [task.name for task in batch.tasks] == ["a_left", "b_left", "kitchen", "one.mcap"]
    assert (batch.align, batch.merge) == (None, None)
    first, _, kitchen, bag = batch.tasks
    assert first.settings == {
        "camera": tmp_path / "drives/a/left/camera.json",
        "odometry": tmp_path / "drives/a/left/odometry.txt",
        "detections": tmp_path / "drives/a/left/boxes.csv",
        "ids": "none",
    }
    assert (kitchen.settings["ids"], kitchen.settings["hold_out"]) == ("class_id", 0.2)
    assert {bag.settings[name] for name in ("camera", "odometry", "detections")} == {
        tmp_path / "one.mcap"
    }
    assert bag.settings["topic"] == ["/odom"]


def test_a_file_is_looked_for_in_the_recording_and_then_beside_the_batch(load, tmp_path):
    (tmp_path / "camera.json").write_text("{}")
    (tmp_path / "table" / "camera.json").write_text("{}")
    batch = load(TOP + '[[recordings]]\nfolder = "table"\n[[recordings]]\nfolder = "drives/a"\n')
    assert [task.settings["camera"] for task in batch.tasks] == [
        tmp_path / "table" / "camera.json",
        tmp_path / "camera.json",
    ]
    # A file that is in neither is missed by the run of that recording alone.
    assert batch.tasks[1].settings["odometry"] == tmp_path / "drives" / "a" / "odometry.txt"


def test_paths_do_not_depend_on_where_the_command_is_called(load, tmp_path, monkeypatch):
    load(TOP + '[[recordings]]\nfolder = "table"\n')
    monkeypatch.chdir(tmp_path)
    (task,) = load_batch(Path("fleet.toml")).tasks
    assert task.settings["camera"] == tmp_path / "table" / "camera.json"


def test_maps_may_be_aligned_and_merged(load):
    batch = load(
        TOP + '[[recordings]]\nfolder = "table"\n[align]\n[merge]\nmotion = "se2"\nsigma = 0.1\n'
    )
    assert batch.align == AlignOptions("auto", None)
    assert batch.merge == MergeOptions("se2", 0.1)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (
            TOP.replace('"none"', '"non"') + 'hold_out = 1.5\n[[recordings]]\nfolder = "tabel"\n'
            'min_scor = 0.1\n[merge]\nmotion = "se4"\n',
            [
                "5: defaults.ids: Input should be 'none', 'track_id' or 'class_id', not 'non'",
                "6: defaults.hold_out: Input should be less than or equal to 0.99, not 1.5",
                "8: folder: there is no such folder tabel",
                "9: unknown key recordings.0.min_scor; did you mean min_score?",
                "11: merge.motion: Input should be 'auto', 'se2' or 'se3', not 'se4'",
            ],
        ),
        (TOP + '[[recordings]]\nfolder = "x*"\n', ["7: folder: nothing fits folder x*"]),
        (
            TOP + '[[recordings]]\nfolder = "drives/*"\nname = "d"\n',
            ["8: name: drives/* is 2 recordings, which need names of their own"],
        ),
        (
            TOP + '[[recordings]]\nfolder = "table"\nname = "../x"\n',
            ["8: name: '../x' is not a name that a folder may have"],
        ),
        (
            TOP + '[[recordings]]\nfolder = "table"\n[[recordings]]\nfolder = "tab*"\n',
            ["8: another recording has the name table, too"],
        ),
        (TOP + "[[recordings]]\nids = 'none'\n", ["6: expected one of folder and bag"]),
        (
            TOP + '[[recordings]]\nfolder = "table"\nbag = "one.mcap"\n',
            ["6: folder and bag: choose one"],
        ),
        (
            '[[recordings]]\nfolder = "table"\ncamera = "c"\ndetections = "d"\n',
            ["1: odometry is missing, here and in [defaults]"],
        ),
        (
            TOP + '[[recordings]]\nfolder = "table"\nout = "x"\n',
            ["8: unknown key recordings.0.out"],
        ),
        ("recordings = []\n", ["1: recordings: there is none"]),
        (TOP, ["recordings is missing"]),
    ],
)
def test_all_mistakes_are_said_with_their_lines(load, tmp_path, text, lines):
    with pytest.raises(FileErrors) as error:
        load(text)
    said = [
        line.removeprefix(f"{tmp_path / 'fleet.toml'}:") for line in str(error.value).split("\n")
    ]
    assert [line.strip() for line in said] == lines
