"""Options from a file, and the file that each result has of them."""

import json
import tomllib

import pytest

import planted
from dqslam.cli import main

DEMO = ["demo", "--drives", "1", "--quiet"]


@pytest.fixture
def settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text):
        (tmp_path / "my.toml").write_text(text)
        return ["--config", "my.toml"]

    return write


def lines(capsys):
    shown = capsys.readouterr()
    assert shown.out == ""
    return shown.err.splitlines()


def test_the_command_line_wins_over_the_file_and_the_file_over_the_default(settings, tmp_path):
    given = settings('drives = 1\nseed = 5\nout = "from_file"\n')
    assert main(["demo", "-q", *given]) == 0
    (drive,) = json.loads((tmp_path / "from_file" / "demo.json").read_text())["drives"]
    assert drive["seed"] == 5
    assert main(["demo", "-q", *given, "--seed", "6", "--out", "mine"]) == 0
    (drive,) = json.loads((tmp_path / "mine" / "demo.json").read_text())["drives"]
    assert drive["seed"] == 6


def test_what_was_in_force_stands_beside_the_result_and_gives_it_again(settings, tmp_path):
    assert main(["simulate", "orbit", "--seed", "3", "--out", "first", "-q"]) == 0
    written = tomllib.loads((tmp_path / "first" / "config.toml").read_text())
    written.pop("dqslam_version", None)  # where the package is not installed
    assert written == {"command": "simulate", "out": "first", "scenario": "orbit", "seed": 3}
    again = ["simulate", "--config", "first/config.toml", "--out", "again", "-q"]
    assert main(again) == 0
    for name in ("boxes.csv", "odometry.txt", "objects.csv", "odometry_covariance.csv"):
        first, second = ((tmp_path / folder / name).read_bytes() for folder in ("first", "again"))
        assert first == second


def test_options_of_a_look_stand_beside_it(settings, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    results = planted.write_planted(tmp_path).results
    before = (results / "config.toml").exists()
    given = settings(f'directory = "{results}"\nalign = "se2"\n')
    figures = results / "figures"
    assert main(["plot", *given, "--kind", "png", "-q"]) == 0
    assert main(["view", *given, "--export", "page", "-q"]) == 0
    assert (results / "config.toml").exists() == before  # that is of `run`
    common = {"directory": str(results), "align": "se2"}
    for path, more in (
        (figures / "plot.toml", {"command": "plot", "kind": "png"}),
        (
            tmp_path / "page" / "view.toml",
            {
                "command": "view",
                "export": "page",
                "foxglove": False,
                "host": "127.0.0.1",
                "port": 8080,
            },
        ),
    ):
        written = tomllib.loads(path.read_text())
        written.pop("dqslam_version", None)
        assert written == common | more
    figure, page = figures / "map.png", tmp_path / "page" / "scene.js"
    first = page.read_bytes()
    figure.unlink()
    page.unlink()
    assert main(["plot", "--config", str(figures / "plot.toml"), "-q"]) == 0
    assert main(["view", "--config", "page/view.toml", "-q"]) == 0
    assert figure.exists()
    assert page.read_bytes() == first


def test_paper_and_its_configuration(tmp_path, capsys):
    options = ["--trials", "1", "--seed", "6", "--jobs", "1", "--object-kind", "ellipsoids", "-q"]
    assert main(["paper", *options, "--out", str(tmp_path / "a")]) == 0
    config = tmp_path / "a" / "config.toml"
    content = tomllib.loads(config.read_text())
    assert (content["object_kind"], content["bound"], content["wrong_associations"]) == (
        "ellipsoids",
        False,
        0.0,
    )
    assert "loss" not in content  # unset: it depends on the rest
    again = ["paper", "--config", str(config), "--out", str(tmp_path / "b"), "--json"]
    assert main(again) == 0
    printed = json.loads(capsys.readouterr().out)
    first = json.loads((tmp_path / "a" / "table.json").read_text())
    for table in (first, printed):
        for row in ("monocular", "relative_position"):
            del table[row]["seconds_per_trial"]
    assert printed == first


def test_all_mistakes_are_said_at_once_with_their_lines(settings, capsys):
    given = settings(
        'command = "paper"\nsead = 1\ndrives = 0\nout = 3\nconfig = "x"\nseed = true\n'
    )
    assert main([*DEMO, *given]) == 2
    said = lines(capsys)
    assert [line.partition("my.toml:")[2][0] for line in said] == list("123456")
    text = "\n".join(said)
    assert "my.toml:1: command: Input should be 'demo', not 'paper'" in text
    assert "my.toml:2: unknown key sead; did you mean seed?" in text
    assert "my.toml:3: drives: Input should be greater than or equal to 1, not 0" in text
    assert "my.toml:4: out: Input should be a valid string, not 3" in text
    assert "my.toml:6: seed: Input should be a valid integer, not True" in text


@pytest.mark.parametrize(
    ("command", "text", "message"),
    [
        ("demo", "drives = 2.5\n", "my.toml:1: drives: Input should be a valid integer"),
        ("run", "trust_ids = 0.3\n", "my.toml:1: trust_ids: Input should be greater than"),
        ("run", 'ids = "name"\n', "my.toml:1: ids: Input should be 'none', 'track_id' or 'cl"),
        ("run", 'format = "tum"\n', "my.toml:1: format: Input should be a valid list"),
        ("run", "format = [1]\n", "my.toml:1: format.0: Input should be a valid string"),
        ("run", 'seed = "1"\n', "my.toml:1: seed: Input should be a valid integer"),
        ("run", "trust_id = 1\n", "my.toml:1: unknown key trust_id; did you mean trust_ids?"),
        ("run", "trust-ids = 1\n", "my.toml:1: unknown key trust-ids; did you mean trust_ids?"),
        ("evaluate", "rpe_delta = [1]\n", "my.toml:1: rpe_delta: Input should be a valid number"),
        ("simulate", "seed 1\n", "my.toml:1: not a TOML file"),
        ("sweep", 'backend = "magic"\n', "my.toml:1: backend: Input should be 'serial', 'proc"),
        ("sweep", "job = 1\n", "my.toml:1: unknown key job; did you mean jobs?"),
        ("plot", 'kind = "gif"\n', "my.toml:1: kind: Input should be 'svg', 'png' or 'pdf'"),
        ("plot", "video_rate = 0.0\n", "my.toml:1: video_rate: Input should be greater than or"),
        ("convert", "topics = 1\n", "my.toml:1: unknown key topics; did you mean topic?"),
        ("view", "port = 0\n", "my.toml:1: port: Input should be greater than or equal to 1"),
        ("view", 'command = "plot"\n', "my.toml:1: command: Input should be 'view', not 'plot'"),
        ("paper", "bound = 1\n", "my.toml:1: bound: Input should be a valid boolean"),
    ],
)
def test_a_mistake_in_the_file(settings, capsys, command, text, message):
    assert main([command, *settings(text)]) == 2
    (line,) = lines(capsys)
    assert line.startswith(f"dqslam: {message}")


def test_a_missing_file(settings, capsys):
    assert main([*DEMO, "--config", "none.toml"]) == 2
    assert lines(capsys) == ["dqslam: none.toml: no such file"]


def test_what_is_required_may_be_in_the_file(settings, tmp_path, capsys):
    assert main(["simulate", "-q", *settings('out = "here"\nscenario = "orbit"\n')]) == 0
    assert (tmp_path / "here" / "boxes.csv").exists()
    assert main(["simulate", "-q", *settings("seed = 1\n")]) == 2
    assert "--out" in lines(capsys)[0]
