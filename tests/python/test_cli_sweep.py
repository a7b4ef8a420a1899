import json
import os
import signal
import subprocess
import sys
import time
import tomllib

import pytest

from dqslam.cli import main

SWEEP = """\
scenario = "paper"
trials = 2

[fixed]
scenario.path.laps = 1
scenario.world.object_count = 4

[grid]
scenario.detector.edge_sigma_px = [1.0, 3.0]
scenario.detector.min_side_px = [100.0, 1e6]
"""
BLIND = "failed: ValueError: "


@pytest.fixture
def command(tmp_path):
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return ["sweep", str(tmp_path / "sweep.toml"), "--out", str(tmp_path / "a" / "b")]


def test_a_table_of_cells_and_each_error_once(command, tmp_path, capsys):
    out = tmp_path / "a" / "b"
    assert main([*command, "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    for printed in ("paper, seeds 0 to 1", "positions, m", "median", "failed", "1e+06"):
        assert printed in shown
    (line,) = [line for line in shown.splitlines() if line.startswith("failed:")]
    assert line.startswith(BLIND)
    assert line.count("_0") == line.count("_1") == 2  # seeds of two cells
    for name in ("results.csv", "summary.json"):
        assert f"wrote {out / name}" in shown.splitlines()
    assert (out / "sweep.toml").read_text() == SWEEP
    assert main([*command, "--jobs", "1"]) == 0
    assert "0 trials run, 8 were finished before" in capsys.readouterr().out


def test_the_table_says_what_the_summary_says(command, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    assert main([*command, "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    cells = json.loads((tmp_path / "a" / "b" / "summary.json").read_text())["cells"]
    spread = cells[0]["metrics"]["rmse_pos"]
    low, high = spread["mean_interval"]
    assert f"{spread['mean']:.3g} [{low:.2g},{high:.2g}]" in shown
    assert f"{cells[0]['metrics']['rmse_landmark']['mean']:.3g}" in shown


def test_what_was_in_force_goes_on_where_it_was(command, tmp_path, capsys):
    assert main([*command, "--jobs", "1", "--quiet"]) == 0
    config = tmp_path / "a" / "b" / "config.toml"
    written = tomllib.loads(config.read_text())
    written.pop("dqslam_version", None)  # where the package is not installed
    assert written == {
        "command": "sweep",
        "file": str(tmp_path / "sweep.toml"),
        "out": str(tmp_path / "a" / "b"),
        "jobs": 1,
    }
    assert main(["sweep", "--config", str(config)]) == 0
    assert "0 trials run, 8 were finished before" in capsys.readouterr().out


def test_json_is_the_summary_and_quiet_is_nothing(command, tmp_path, capsys):
    assert main([*command, "--jobs", "1", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out) == json.loads((tmp_path / "a" / "b" / "summary.json").read_text())
    assert main([*command, "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("change", "arguments", "messages"),
    [
        (
            ("edge_sigma_px", "edge_sigma"),
            [],
            ["sweep.toml:9: unknown key scenario.detector.edge_sigma; did you mean edge_sigma_px?"],
        ),
        (
            ("[1.0, 3.0]", '[-1.0, "x"]'),
            [],
            ["sweep.toml:9: scenario.detector.edge_sigma_px: Input should be "] * 2,
        ),
        (("", ""), ["--backend", "magic"], ["'magic' is not one of 'serial', 'processes'"]),
        (("", ""), ["--scheduler", "tcp://x:1"], ["scheduler: backend loky has none"]),
        (("", ""), ["--backend", "ray"], ["ray needs ray, missing: pip install ray"]),
    ],
)
def test_bad_input_is_a_line_for_each_mistake(command, capsys, change, arguments, messages):
    with open(command[1], "w") as file:
        file.write(SWEEP.replace(*change))
    assert main([*command, *arguments]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(messages)
    for line, message in zip(lines, messages, strict=True):
        assert line.startswith("dqslam: ")
        assert message in line


def test_ctrl_c_is_one_line_and_what_is_done_is_kept(command, tmp_path):
    """As from a terminal, which tells the workers too."""
    (tmp_path / "sweep.toml").write_text(SWEEP.replace("trials = 2", "trials = 50"))
    trials = tmp_path / "a" / "b" / "trials"
    code = "import sys; from dqslam.cli import main; sys.exit(main())"
    run = subprocess.Popen(
        [sys.executable, "-c", code, *command, "--jobs", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A test run in the background of a shell ignores Ctrl-C, and hands that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not list(trials.glob("[!.]*.json")) and run.poll() is None:
        time.sleep(0.005)
    os.killpg(run.pid, signal.SIGINT)
    _, said = run.communicate(timeout=60)
    assert (run.returncode, said) == (130, "dqslam: stopped\n")
    kept = list(trials.iterdir())
    assert all(json.loads(path.read_text())["key"] == path.stem for path in kept)
    assert 0 < len(kept) < 200
