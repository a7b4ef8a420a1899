import json
from importlib import import_module

import pytest

pytest.importorskip("matplotlib")
from PIL import Image

import planted
import realdata
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.metrics import up_direction

FIGURES = ["boxes", "map", "path_error", "position_error", "residuals", "rotation_error"]
SIZE = (planted.CAMERA.width, planted.CAMERA.height)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("planted"))


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Return a folder of an image for each pose, in their order."""
    folder = tmp_path_factory.mktemp("images")
    for pose in range(planted.POSES):
        Image.new("RGB", SIZE, (90, 90, 90)).save(folder / f"left_{pose:03}.jpg")
    return folder


def run(capsys, *arguments):
    code = main(["plot", *map(str, arguments)])
    return code, capsys.readouterr()


def written(kind):
    return sorted(["manifest.json", "plot.toml", *(f"{name}.{kind}" for name in FIGURES)])


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_with_the_truth(tmp_path, capsys, files):
    code, said = run(
        capsys, files.results, "--out", tmp_path / "new", "--kind", "png",
        "--groundtruth", files.groundtruth, "--objects", files.objects,
    )  # fmt: skip
    assert (code, said.err) == (0, "")
    assert names(tmp_path / "new") == written("png")
    assert said.out.splitlines() == [f"wrote {tmp_path / 'new' / name}.png" for name in FIGURES]


def test_without_it_json_says_what_is_left_out(tmp_path, capsys, files):
    code, said = run(capsys, files.results, "--out", tmp_path, "--json")
    assert code == 0
    found = json.loads(said.out)
    assert found["figures"] == [str(tmp_path / f"{n}.svg") for n in ("boxes", "map", "residuals")]
    assert set(found["left_out"]) == {"path_error", "position_error", "rotation_error"}


def test_a_simulated_recording_has_its_truth_beside(tmp_path, capsys):
    assert main(["simulate", "orbit", "--out", str(tmp_path / "sim"), "--quiet"]) == 0
    assert main(["run", "--config", str(tmp_path / "sim" / "run.toml"), "--quiet"]) == 0
    for given in (tmp_path / "sim", tmp_path / "sim" / "results"):
        code, said = run(capsys, given, "--out", tmp_path / "of" / given.name, "--quiet")
        assert (code, said.out) == (0, "")
        assert names(tmp_path / "of" / given.name) == written("svg")


def test_a_table_top_with_images_by_their_numbers(tmp_path, capsys):
    """Its times are the numbers of images, its objects lie on a table: z is up."""
    folder = realdata.recording("bop_lmo")
    segment = folder / "seg_0703_1001"
    results = tmp_path / "results"
    code = main(
        [
            "run", "--quiet", "--camera", str(folder / "camera.json"), "--ids", "class_id",
            "--odometry", str(segment / "groundtruth.txt"), "--out", str(results),
            "--detections", str(segment / "detections_fasterrcnn.csv"), "--mode", "mapping",
        ]
    )  # fmt: skip
    assert code == 0
    capsys.readouterr()
    (tmp_path / "rgb").mkdir()
    for number in (703, 1001):
        Image.new("RGB", (640, 480)).save(tmp_path / "rgb" / f"{number:06}.png")
    code, said = run(
        capsys, results, "--images", tmp_path / "rgb",
        "--groundtruth", segment / "groundtruth.txt", "--objects", segment / "objects_gt.csv",
    )  # fmt: skip
    assert (code, said.err) == (0, "")
    assert names(results / "figures" / "images") == ["000703.png", "001001.png"]
    found = load_results(results)
    assert up_direction(found.poses).tolist() == [0.0, 0.0, 1.0]


def test_stills_of_some_frames(tmp_path, capsys, files, images):
    code, _ = run(
        capsys, files.results, "--out", tmp_path, "--images", images, "--frames", "3,10-14:2"
    )
    assert code == 0
    assert names(tmp_path / "images") == [f"left_{pose:03}.png" for pose in (3, 10, 12, 14)]
    with Image.open(tmp_path / "images" / "left_003.png") as still:
        assert still.size == SIZE
    code, _ = run(capsys, files.results, "--out", tmp_path / "few", "--images", images)
    assert (code, len(names(tmp_path / "few" / "images"))) == (0, 9)


def test_a_film(tmp_path, capsys, files, images):
    film = tmp_path / "film.gif"
    code, said = run(
        capsys, files.results, "--out", tmp_path, "--images", images, "--frames", "0-4",
        "--video", film, "--video-rate", 4,
    )  # fmt: skip
    assert code == 0
    assert f"wrote {film}" in said.out
    with Image.open(film) as found:
        assert (found.n_frames, found.info["duration"]) == (5, 250)


def test_times_of_frames_from_a_file(tmp_path, capsys, files, images):
    """Frame 5 was taken at the third pose, whatever the order of the images."""
    third = load_results(files.results).timestamps[2]
    (tmp_path / "frames.csv").write_text(f"frame,timestamp\n5,{third}\n6,{third + 1e5}\n")
    code, said = run(
        capsys, files.results, "--out", tmp_path / "out", "--images", images,
        "--frame-times", tmp_path / "frames.csv", "--frames", "2",
    )  # fmt: skip
    assert (code, said.err) == (0, "")
    assert names(tmp_path / "out" / "images") == ["left_005.png"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--frames", "3"], "--frames and --video need --images"),
        (["--images", "IMAGES", "--frames", "7-3"], "--frames: '7-3' is not like 7, 7-20 or"),
        (["--images", "IMAGES", "--frames", "x"], "--frames: 'x' is not like"),
        (["--images", "IMAGES", "--frames", "999"], "no image is of a pose among 999"),
        (["--images", "IMAGES", "--video", "film.avi"], "film.avi: its name ends in none of"),
        (["--images", "none"], "none: no such folder of images"),
        (["--groundtruth", "none.txt"], "none.txt: no such file"),
        (
            ["--images", "IMAGES", "--frame-rate", "1", "--frame-times", "x.csv"],
            "--frame-times and --frame-rate both give",
        ),
        (["--parameter", "seed"], "--parameter needs a sweep"),
    ],
)
def test_a_mistake_is_one_line_and_nothing_is_written(
    tmp_path, capsys, files, images, options, message
):
    options = [str(images) if one == "IMAGES" else one for one in options]
    code, said = run(capsys, files.results, "--out", tmp_path / "out", *options)
    assert code == 2
    assert message in said.err
    assert said.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_directory_that_is_not_there(tmp_path, capsys):
    code, said = run(capsys, tmp_path / "none")
    assert (code, said.err) == (2, f"dqslam: {tmp_path / 'none'}: no such directory\n")


def test_a_sweep(tmp_path, capsys):
    spread = {"median": 1.0, "median_interval": [0.5, 1.5]}
    summary = {
        "parameters": ["noise"],
        "units": {"rmse_pos": "m"},
        "confidence": 0.95,
        "trials": 8,
        "cells": [{"values": {"noise": 1.0}, "metrics": {"rmse_pos": spread}}],
    }
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    code, said = run(capsys, tmp_path, "--kind", "pdf", "--parameter", "noise")
    assert (code, said.out) == (0, f"wrote {tmp_path / 'figures' / 'sweep.pdf'}\n")
    assert (tmp_path / "figures" / "sweep.pdf").read_bytes().startswith(b"%PDF")


def test_without_matplotlib_the_error_says_how_to_get_it(capsys, files, monkeypatch):
    monkeypatch.setattr(import_module("dqslam.cli.plot"), "find_spec", lambda name: None)
    code, said = run(capsys, files.results)
    assert (code, said.err) == (2, "dqslam: figures need matplotlib: pip install 'dqslam[plot]'\n")
