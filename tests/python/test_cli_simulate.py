"""The commands that need no files of one's own: demo and simulate; and on from there."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core, build_graph, load_scenario, simulate, solve
from dqslam.cli import main
from dqslam.io import read_trajectory


def test_a_simulated_recording_is_run_and_evaluated_at_once(tmp_path, monkeypatch, capsys):
    """`run` learns sizes and doubts boxes; its trajectory is `solve`'s to 3 cm all the same."""
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "orbit", "--seed", "1", "--out", "sim"]) == 0
    shown = capsys.readouterr().out
    assert "poses: 150\n" in shown
    for line in shown.splitlines()[-2:]:
        command = line.partition(": dqslam ")[2].split()
        assert main([*command, "--json"]) == 0
        result = json.loads(capsys.readouterr().out)
    evaluation = json.loads((tmp_path / "sim/results/evaluation.json").read_text())
    assert result == evaluation
    assert (evaluation["objects"]["matched"], evaluation["objects"]["missed"]) == (8, 0)
    assert evaluation["association"]["purity"] == 1.0
    assert evaluation["ate"]["rmse"] < 0.2 * evaluation["odometry_ate"]["rmse"]
    recording, truth = simulate(load_scenario("orbit"), seed=1)
    estimate, _ = solve(build_graph(replace(recording, positions=None)))
    cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, estimate.poses)
    found = read_trajectory(tmp_path / "sim/results/trajectory.txt").world_from_camera
    off = np.linalg.norm(found[:, :3] - cameras[:, :3], axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.03
    odometry = np.linalg.norm(estimate.initial_poses[:, :3] - truth.poses[:, :3], axis=1)
    assert odometry.max() > 0.3


def test_what_simulate_writes(tmp_path, capsys):
    assert main(["simulate", "--out", str(tmp_path), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["scenario"], summary["seed"], summary["poses"]) == ("paper", 0, 253)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "boxes.csv",
        "camera.json",
        "config.toml",
        "evaluate.toml",
        "groundtruth.txt",
        "manifest.json",
        "objects.csv",
        "odometry.txt",
        "odometry_covariance.csv",
        "run.toml",
        "true_boxes.csv",
    ]
    rows = (tmp_path / "boxes.csv").read_text().splitlines()
    assert len(rows) == summary["boxes"] + 1


def test_demo_writes_a_directory_for_each_drive_and_a_picture(tmp_path, capsys):
    out = tmp_path / "a" / "b"
    assert main(["demo", "--drives", "2", "--seed", "5", "--out", str(out)]) == 0
    drives = json.loads((out / "demo.json").read_text())["drives"]
    assert [drive["seed"] for drive in drives] == [5, 6]
    for drive in drives:
        assert drive["rmse_pos"] < 0.3 * drive["odometry_rmse_pos"]
        folder = out / f"seed{drive['seed']}"
        objects = json.loads((folder / "map.json").read_text())["objects"]
        assert len(objects) == drive["objects"]
        boxes = (folder / "boxes.csv").read_text().splitlines()
        assert len(boxes) == drive["boxes"] + 1
    assert (out / "maps.png").read_bytes()[:4] == b"\x89PNG"
    shown = capsys.readouterr()
    assert shown.err == ""
    assert f"{drives[0]['rmse_pos']:.2f}" in shown.out
    assert f"wrote {out / 'maps.png'}" in shown.out


def test_demo_without_matplotlib_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("dqslam.cli.results.find_spec", lambda name: None)
    assert main(["demo", "--drives", "1", "--out", str(tmp_path)]) == 0
    assert "no maps.png: matplotlib is missing" in capsys.readouterr().out
    assert not (tmp_path / "maps.png").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "moon"], "moon: no such scenario; by name there are:"),
        (["simulate", "--seed", "-1"], "--seed"),
        (["demo", "--drives", "0"], "--drives"),
    ],
)
def test_bad_arguments_are_one_line_and_leave_nothing(tmp_path, capsys, arguments, message):
    out = tmp_path / "deep" / "out"
    assert main([*arguments, "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not out.parent.exists()
