"""Commands never write over their inputs or into folders of others, and say which file changed."""

import os
import shutil
import subprocess
import sys

import pytest

from dqslam.cli import main
from dqslam.io import load_results


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a simulated recording with results in it."""
    folder = tmp_path_factory.mktemp("made") / "rec"
    assert main(["simulate", "orbit", "--seed", "1", "--out", str(folder), "-q"]) == 0
    assert main(["run", "--config", str(folder / "run.toml"), *run_of(folder), "-q"]) == 0
    return folder


def run_of(folder):
    names = {"camera": "camera.json", "odometry": "odometry.txt", "detections": "boxes.csv"}
    return [word for key, name in names.items() for word in (f"--{key}", str(folder / name))]


@pytest.fixture
def rec(made, tmp_path):
    return shutil.copytree(made, tmp_path / "rec")


MEASURED = ("--positions", "--absolute", "--closures", "--frame-times", "--camera-in-body")


def only_line(text):
    (line,) = text.splitlines()
    return line


def snapshot(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(capsys, *command):
    capsys.readouterr()
    assert main([str(word) for word in command]) == 2
    return only_line(capsys.readouterr().err)


def commands(rec, tmp_path):
    """Return commands that would write over something, and the path that each must name."""
    results, mine = rec / "results", tmp_path / "mine"
    mine.mkdir()
    (mine / "notes.txt").write_text("mine")
    (mine / "sweep.toml").write_text('scenario = "paper"\n[vary]\n"estimator.loss" = ["none"]\n')
    (mine / "link.ply").symlink_to(results / "map.json")
    truth = ["--groundtruth", rec / "groundtruth.txt"]
    return [
        (["run", *run_of(rec), "--out", rec], rec),
        (["run", *run_of(rec), "--out", mine], mine),
        (["run", *run_of(results), "--out", results], results),
        (["run", *run_of(rec), "--out", mine / "notes.txt"], mine / "notes.txt"),
        *[
            (["run", *run_of(rec), option, results / "covariance.csv", "--out", results], results)
            for option in MEASURED
        ],
        (["simulate", "orbit", "--out", mine], mine),
        (["simulate", "orbit", "--out", rec], rec),  # its results are another command's
        (["simulate", "orbit", "--out", results], results),
        (["demo", "--out", mine], mine),
        (["paper", "--trials", "1", "--out", mine], mine),
        (["worlds", "plates", "--trials", "1", "--out", mine], mine),
        (["ablation", "--trials", "1", "--out", mine], mine),
        (["degeneracy", "--trials", "1", "--out", mine], mine),
        (["sweep", mine / "sweep.toml", "--out", mine], mine),
        (["plot", results, "--out", results], results),
        (["plot", results, "--out", mine], mine),
        (["view", results, "--export", mine], mine),
        (["view", results, "--export", results], results),
        (["view", results, "--ply", results / "map.json"], results / "map.json"),
        (["view", results, "--ply", mine / "link.ply"], mine / "link.ply"),
        (["convert", rec / "boxes.csv", rec / "boxes.csv"], rec / "boxes.csv"),
        (
            ["convert", rec / "boxes.csv", mine, "--to", "yolo", "--camera", rec / "camera.json"],
            mine,
        ),
        (
            ["convert", rec / "boxes.csv", rec / "camera.json", "--to", "coco", "--camera"]
            + [rec / "camera.json"],
            rec / "camera.json",
        ),
        (["convert", results, results / "map.json", "--to", "g2o"], results / "map.json"),
        (["convert", results, results, "--to", "colmap-model"], results),
        (["evaluate", rec, *truth], rec / "trajectory.txt"),
    ]


def test_every_command_refuses_before_the_work(rec, tmp_path, capsys):
    for command, path in commands(rec, tmp_path):
        before = snapshot(tmp_path)
        said = refused(capsys, *command)
        assert str(path) in said, command
        assert snapshot(tmp_path) == before, command


@pytest.mark.parametrize("command", ["convert", "run"])
def test_a_file_that_is_standard_input_is_not_written_over(rec, command):
    results = rec / "results"
    if command == "convert":
        words, path = ["-", rec / "boxes.csv", "--format", "csv"], rec / "boxes.csv"
        out = path
    else:
        path, out = results / "boxes.csv", results
        words = [*run_of(rec)[:4], "--detections", "-", "--out", out]
    before = snapshot(rec)
    program = "import sys; from dqslam.cli import main; sys.exit(main())"
    call = [sys.executable, "-c", program, command, *map(str, words)]
    with path.open() as file:
        result = subprocess.run(call, stdin=file, capture_output=True, text=True, timeout=60)
    assert result.returncode == 2
    assert only_line(result.stderr).startswith(f"dqslam: {out}: ")
    assert "input" in result.stderr or "read by this run" in result.stderr
    assert snapshot(rec) == before


def test_evaluate_leaves_a_users_file(rec, tmp_path, capsys):
    truth = ["--groundtruth", rec / "groundtruth.txt"]
    (rec / "results" / "evaluation.json").write_text("mine")
    said = refused(capsys, "evaluate", rec / "results", *truth)
    assert "evaluation.json: is there already" in said
    assert (rec / "results" / "evaluation.json").read_text() == "mine"


def test_the_same_command_again_leaves_nothing_of_before(rec, capsys):
    results, truth = rec / "results", ["--groundtruth", str(rec / "groundtruth.txt")]
    for _ in range(2):
        assert main(["evaluate", str(results), *truth, "-q"]) == 0
    assert (results / "evaluation.json").exists()
    again = ["run", "--config", str(results / "config.toml"), "--ids", "none", "-q"]
    again += ["--out", str(results)]
    assert main(again) == 0
    assert not (results / "evaluation.json").exists()
    assert len(load_results(results).objects) == 8
    assert capsys.readouterr().err == ""


def test_options_that_were_edited_are_the_users(rec, capsys):
    config = rec / "results" / "config.toml"
    with config.open("a") as file:
        file.write("# mine\n")
    said = refused(capsys, "run", "--config", config, "--out", rec / "results")
    assert "holds config.toml, changed since" in said
    assert config.read_text().endswith("# mine\n")


def test_a_changed_file_is_a_warning_and_the_work_goes_on(rec, capsys):
    results = rec / "results"
    text = (results / "odometry.txt").read_text()
    (results / "odometry.txt").write_text(text.replace("\n", " \n", 1))
    for command in (["plot", results], ["view", results, "--ply", rec / "map.ply"]):
        capsys.readouterr()
        assert main([*map(str, command), "-q"]) == 0
        assert capsys.readouterr().err == (
            f"warning: {results / 'odometry.txt'}: has been changed since it was written "
            "with the other files\n"
        )


def test_output_into_pipes_and_devices(rec, capfd):
    assert main(["view", str(rec / "results"), "--ply", "/dev/stdout", "-q"]) == 0
    assert capfd.readouterr().out.startswith("ply\n")
    assert main(["convert", str(rec / "odometry.txt"), "/dev/null", "--to", "kitti", "-q"]) in (
        0,
        2,
    )
    assert not os.path.isfile("/dev/null")
