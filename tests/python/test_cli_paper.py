import json
import os
import signal
import struct
import subprocess
import sys
import time

import pytest

from dqslam.cli import main
from dqslam.studies.paper import methods, trial

RUN = "import sys; from dqslam.cli import main; sys.exit(main())"


def png_size(path):
    header = path.read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", header[16:])


def only_line(text):
    (line,) = text.splitlines()
    return line


def test_table_and_figure(tmp_path, capsys):
    out = tmp_path / "a" / "b"
    assert main(["paper", "--trials", "1", "--seed", "6", "--out", str(out), "--jobs", "1"]) == 0
    table = json.loads((out / "table.json").read_text())
    assert (table["trials"], table["seed"], table["objects"]) == (1, 6, "cubes")
    assert table["method"] == "dqslam"
    assert table["monocular"]["rmse_pos"]["avg"] < 0.2 * table["odometry"]["rmse_pos"]["avg"]
    assert "scan" not in table
    width, height = png_size(out / "maps.png")
    assert min(width, height) > 500
    shown = capsys.readouterr().out
    # The paper's own figures stand beside ours.
    for printed in ("5.31", "4.03", "4.12", "3.33", "7.28", "0.13"):
        assert printed in shown
    assert f"{table['odometry']['rmse_pos']['avg']:.2f}" in shown
    assert str(out / "table.json") in shown.replace("\n", "")


def test_the_papers_method_shows_its_scan(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(methods, "ALGEBRAIC_SIGMAS", (1e10, 1e15))
    # The earlier name of --object-kind still works.
    command = ["paper", "--trials", "1", "--method", "paper", "--objects", "ellipsoids"]
    assert main([*command, "--out", str(tmp_path), "--jobs", "1"]) == 0
    table = json.loads((tmp_path / "table.json").read_text())
    assert (table["method"], table["objects"]) == ("paper", "ellipsoids")
    assert [one["algebraic_sigma"] for one in table["scan"]["monocular"]] == [1e10, 1e15]
    assert table["scan"]["monocular"][0]["rmse_pos"] == table["monocular"]["rmse_pos"]
    shown = capsys.readouterr().out
    assert "1e+10" in shown
    assert "1e+15" in shown


def test_the_bound_and_wrong_ids_add_to_each_row(tmp_path, capsys):
    command = ["paper", "--trials", "1", "--seed", "6", "--jobs", "1", "--bound"]
    command += ["--wrong-associations", "0.2", "--wrong-kind", "structured"]
    assert main([*command, "--loss", "cauchy", "--out", str(tmp_path)]) == 0
    table = json.loads((tmp_path / "table.json").read_text())
    assert (table["loss"], table["wrong_association_kind"]) == ("cauchy", "structured")
    for row in (table["monocular"], table["relative_position"]):
        assert row["failures"] == 0
        assert 0.3 < row["efficiency"] < 3.0
        assert row["optimum_rate"] in (0.0, 1.0)
        assert 0.85 < row["inlier_precision"] <= 1.0  # at the 99.9 % quantile
        assert row["volume_relative_error"]["med"] < 0.5
    shown = capsys.readouterr().out
    for label in ("error / bound", "95 % interval", "inliers, recall", "oracle: centers"):
        assert label in shown


def test_another_scenario_stands_beside_nothing_printed(tmp_path, capsys):
    command = ["paper", "--scenario", "honest", "--trials", "1", "--jobs", "1"]
    assert main([*command, "--out", str(tmp_path)]) == 0
    table = json.loads((tmp_path / "table.json").read_text())
    assert (table["scenario"], table["objects"]) == ("honest", "ellipsoids")
    assert table["monocular"]["worse_than_odometry"] == []
    shown = capsys.readouterr().out
    assert "honest, seeds 0 to 0, ellipsoids" in shown
    assert "worse than odometry" in shown
    assert "5.31" not in shown


def test_failures_are_shown(tmp_path, capsys, monkeypatch):
    def fail(graph, options):
        raise ValueError("row 3: [bad] input")

    monkeypatch.setattr(trial, "solve", fail)
    assert main(["paper", "--trials", "1", "--out", str(tmp_path), "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    assert "failed: monocular, seed 0: ValueError: row 3: [bad] input" in shown
    assert "no maps.png: no monocular trial succeeded" in shown
    assert json.loads((tmp_path / "table.json").read_text())["monocular"]["failures"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--trials", "0"], "--trials"),
        (["--trials", "many"], "--trials"),
        (["--seed", "-1"], "--seed"),
        (["--jobs", "0"], "--jobs"),
        (["--object-kind", "spheres"], "--object-kind"),
        (["--method", "magic"], "--method"),
        (
            ["--scenario", "moon"],
            "moon: no such scenario; by name there are: honest, honest_orbit, orbit, paper",
        ),
        (["--wrong-associations", "0.5"], "--wrong-associations"),
        (["--loss", "l1"], "'l1' is not one of 'none', 'huber', 'cauchy', 'dcs', 'switchable'"),
        (["--wrong-kind", "swap"], "'swap' is not one of 'random', 'structured'"),
        (["--method", "paper", "--bound"], "method: the paper's has neither"),
        (["--wrong"], "No such option: --wrong"),
    ],
)
def test_bad_arguments_are_one_line_and_exit_code_2(tmp_path, capsys, arguments, message):
    assert main(["paper", "--out", str(tmp_path), *arguments]) == 2
    line = only_line(capsys.readouterr().err)
    assert line.startswith("dqslam: ")
    assert message in line


def test_an_unusable_directory_is_said_before_any_work(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["paper", "--out", str(tmp_path / "file")]) == 2
    assert "file" in only_line(capsys.readouterr().err)


def test_out_is_required(capsys):
    assert main(["paper"]) == 2
    assert "--out" in only_line(capsys.readouterr().err)


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_ctrl_c_is_one_line_and_exit_code_130(tmp_path, seconds):
    """As from a terminal, which tells the workers too: while they start, and later."""
    out = tmp_path / "out"
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, "paper", "--trials", "99", "--jobs", "2", "--out", str(out)],
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


def test_help_is_quick_and_lists_the_command():
    """Neither help nor the package import what only a run needs."""
    code = (
        "import sys; from dqslam.cli import main; code = main(['--help']);"
        "assert 'matplotlib' not in sys.modules and 'scipy' not in sys.modules; sys.exit(code)"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert shown.returncode == 0, shown.stderr
    assert "paper" in shown.stdout
