import json
import os
import signal
import subprocess
import sys
import time
import tomllib

import pytest

from dqslam.cli import main
from dqslam.studies.worlds import trial as trial_module

RUN = "import sys; from dqslam.cli import main; sys.exit(main())"
SMALL = 'base = "paper"\ntitle = "a few"\n[path]\nlaps = 1\n[world]\nobject_count = 4\n'


@pytest.fixture
def small(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    return ["worlds", str(tmp_path / "small.toml"), "--trials", "2", "--jobs", "1", "--seed", "3"]


def only_line(text):
    (line,) = text.splitlines()
    return line


def test_a_table_and_files(small, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    out = tmp_path / "a" / "b"
    assert main([*small, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    for printed in ("seeds 3 to 4", "small", "default", "2 of 2", "NEES"):
        assert printed in shown
    assert "told" not in shown  # its objects are cubes
    for name in ("worlds.md", "trials.csv", "worlds.json"):
        assert f"wrote {out / name}" in shown.splitlines()
    result = json.loads((out / "worlds.json").read_text())
    row = result["worlds"]["small"]["default"]
    assert (result["seed"], result["trials"], row["at_optimum"]) == (3, 2, 2)
    assert row["positions"]["max"] < result["worlds"]["small"]["odometry"]["avg"]
    assert "`small`: a few" in (out / "worlds.md").read_text()


def test_what_was_in_force_can_be_run_again(small, tmp_path, capsys):
    out = tmp_path / "out"
    command = [*small, "--row", "default", "--row", "told", "--out", str(out)]
    assert main([*command, "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    config = tomllib.loads((out / "config.toml").read_text())
    config.pop("dqslam_version", None)  # where the package is not installed
    assert config == {
        "command": "worlds",
        "names": [str(tmp_path / "small.toml")],
        "trials": 2,
        "seed": 3,
        "row": ["default", "told"],
        "out": str(out),
        "jobs": 1,
    }
    before = (out / "trials.csv").read_bytes()
    assert main(["worlds", "--config", str(out / "config.toml"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads((out / "worlds.json").read_text())
    assert (out / "trials.csv").read_bytes() == before


def test_a_page_gets_the_table(small, tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("<!-- table of the worlds --><!-- end of the table -->")
    assert main([*small, "--out", str(tmp_path / "out"), "--page", str(page)]) == 0
    assert (tmp_path / "out" / "worlds.md").read_text() in page.read_text()
    assert f"wrote {page}" in capsys.readouterr().out.splitlines()


def test_failures_are_shown(small, tmp_path, capsys, monkeypatch):
    def fail(graph, options):
        raise ValueError("row 3: [bad] input")

    monkeypatch.setattr(trial_module, "solve", fail)
    assert main([*small, "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    expected = "failed: small, default, seed 3: ValueError: row 3: [bad] input (and 1 more)"
    assert expected in shown.splitlines()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["moon"], "moon: no such scenario; by name there are: honest, honest_orbit, orbit, paper"),
        (["loop", "loop"], "scenarios: expected one or more, of different names"),
        (
            ["loop", "--row", "magic"],
            "--row: 'magic' is none of told, calibrated, default, plain, run",
        ),
        (["loop", "--row", "told", "--trials", "0"], "--trials"),
        (["loop_cubes", "--row", "told"], "loop_cubes has nothing for told: no right sigmas"),
        (["loop", "--page", "no/such/page.md"], "page.md"),
    ],
)
def test_bad_arguments_are_one_line_and_exit_code_2(tmp_path, capsys, arguments, message):
    assert main(["worlds", *arguments, "--out", str(tmp_path / "out")]) == 2
    line = only_line(capsys.readouterr().err)
    assert line.startswith("dqslam: ")
    assert message in line


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_ctrl_c_is_one_line_and_exit_code_130(tmp_path, seconds):
    out = tmp_path / "out"
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, "worlds", "--trials", "99", "--jobs", "2", "--out", str(out)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A test run in the background of a shell ignores Ctrl-C, and hands that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not out.exists() and run.poll() is None:
        time.sleep(0.01)
    time.sleep(seconds)
    os.killpg(run.pid, signal.SIGINT)
    _, said = run.communicate(timeout=60)
    assert (run.returncode, only_line(said)) == (130, "dqslam: stopped")
    assert not out.exists()
