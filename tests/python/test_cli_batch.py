"""``dqslam batch`` on small recordings, whole, killed and stopped."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib

import pytest

from dqslam.cli import main
from small_fleet import FLEET, write_fleet

PROGRAM = "import sys; from dqslam.cli import main; sys.exit(main())"


def rows_of(folder):
    with (folder / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def command_of(path, *more):
    return ["batch", str(path), "--out", str(path.parent / "out"), "--quiet", *more]


def start(command):
    """Start a command in a group of its own, as a terminal does, which may tell it of Ctrl-C."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *command],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A test run in the background of a shell ignores Ctrl-C, and hands that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def finished_in(out):
    return {path: path.stat().st_mtime_ns for path in (out / "recordings").glob("*/manifest.json")}


def wait_for(count, out, process):
    while len(finished_in(out)) < count and process.poll() is None:
        time.sleep(0.02)


def test_recordings_are_run_as_by_run_and_one_that_fails_is_said(tmp_path, capsys):
    path = write_fleet(tmp_path, "abc", FLEET + "[align]\n[merge]\nmotion = 'se3'\n")
    broken = tmp_path / "drives" / "b" / "camera.json"
    whole = broken.read_text()
    broken.write_text('{\n"fx": }\n')
    command = command_of(path, "--jobs", "1")
    out = tmp_path / "out"
    assert main(command) == 4
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith(f"warning: b failed: {broken}:2: ")
    rows = rows_of(out)
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert [row["exit_code"] for row in rows] == ["0", "2", "0"]
    assert line.endswith(rows[1]["error"])
    assert (rows[0]["poses"], rows[0]["objects"], rows[1]["poses"]) == ("12", "4", "")
    assert float(rows[0]["ate_m"]) < 0.01  # the odometry is the truth, and stays
    alone = tmp_path / "alone"
    config = (out / "runs" / "a.toml").read_text()
    (tmp_path / "a.toml").write_text(config)
    assert main(["run", "--config", str(tmp_path / "a.toml"), "--out", str(alone), "-q"]) == 0
    for name in ("trajectory.txt", "map.json", "covariance.csv", "boxes.csv"):
        assert (alone / name).read_bytes() == (out / "recordings" / "a" / name).read_bytes()
    assert tomllib.loads((out / "config.toml").read_text())["file"] == str(path)
    assert (out / "batch.toml").read_text() == path.read_text()
    # The maps are of one table, each in the frame of a trajectory that is true.
    (alignment,) = json.loads((out / "alignments.json").read_text())["alignments"]
    assert alignment["name"] == "c"
    for row in range(4):
        expected = [float(row == column) for column in range(4)]
        assert alignment["b_from_a"][row] == pytest.approx(expected, abs=0.03)
    assert len(json.loads((out / "merged" / "map.json").read_text())["objects"]) == 4

    before = finished_in(out)
    broken.write_text(whole)
    assert main([*command, "--json"][:4] + ["--json", "--jobs", "1"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["status"] for row in told["recordings"]] == ["done"] * 3
    assert told["merged"] == str(out / "merged")
    assert {path: finished_in(out)[path] for path in before} == before


def test_a_table_for_people(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    path = write_fleet(tmp_path, ["first", "second_drive"])
    assert main([one for one in command_of(path, "--jobs", "1") if one != "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "…" not in shown
    assert "second_drive" in shown
    assert f"wrote {tmp_path / 'out' / 'results.csv'}" in shown
    assert main([one for one in command_of(path, "--jobs", "1") if one != "--quiet"]) == 0
    assert "0 recordings run, 2 were finished before" in capsys.readouterr().out


def test_maps_of_other_places_are_doubtful(tmp_path, capsys):
    path = write_fleet(tmp_path, "ab", FLEET + "[merge]\n")
    boxes = tmp_path / "drives" / "b" / "boxes.csv"
    boxes.write_text(boxes.read_text().replace("cup", "car").replace("book", "tree"))
    assert main(command_of(path, "--jobs", "1")) == 3
    assert "warning: not merged: " in capsys.readouterr().err
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["done", "done"]
    assert not (tmp_path / "out" / "merged").exists()


def test_killed_and_gone_on_with(tmp_path):
    path = write_fleet(tmp_path, "abc")
    out = tmp_path / "out"
    process = start(command_of(path, "--jobs", "1"))
    wait_for(1, out, process)
    process.send_signal(signal.SIGKILL)
    assert process.wait(timeout=60) == -signal.SIGKILL
    assert not (out / "results.csv").exists()
    time.sleep(1.5)  # until the run that it had started has noticed
    kept = finished_in(out)
    assert 1 <= len(kept) < 3
    assert main(command_of(path, "--jobs", "1")) == 0
    assert {path: finished_in(out)[path] for path in kept} == kept
    assert [row["name"] for row in rows_of(out)] == ["a", "b", "c"]
    assert sorted(os.listdir(out / "recordings")) == ["a", "b", "c"]


def test_ctrl_c_is_one_line_and_ends_all_processes(tmp_path):
    path = write_fleet(tmp_path, "abc")
    out = tmp_path / "out"
    process = start(command_of(path, "--jobs", "2"))
    wait_for(1, out, process)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, "dqslam: stopped\n")
    with pytest.raises(ProcessLookupError):  # nobody of the group is left
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    assert 1 <= len(finished_in(out)) < 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"drives/*"', '"drive/*"', "fleet.toml:8: folder: nothing fits folder drive/*"),
        ("[defaults]", "[default]", "fleet.toml:1: unknown key default; did you mean defaults?"),
    ],
)
def test_a_wrong_file_is_refused_before_anything_is_written(tmp_path, capsys, old, new, message):
    path = write_fleet(tmp_path, "a", FLEET.replace(old, new))
    assert main(command_of(path)) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_results_of_others_are_not_touched(tmp_path, capsys):
    path = write_fleet(tmp_path, "a")
    shutil.copytree(tmp_path / "drives", tmp_path / "out")
    assert main(command_of(path)) == 2
    assert "out: is there already, and not empty" in capsys.readouterr().err
