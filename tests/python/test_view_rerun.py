"""A Rerun file, read back by the SDK."""

import sys

import numpy as np
import pytest

import planted
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.view import build_scene, write_rerun


@pytest.fixture
def files(tmp_path):
    return planted.write_planted(tmp_path)


def read(path):
    """Return the columns of each entity, by path: arrays of rows."""
    chunk = pytest.importorskip("rerun.chunk")
    columns = {}
    for one in chunk.RrdReader(path).stream():
        batch = one.to_record_batch()
        for name in batch.schema.names:
            rows = batch.column(name).to_pylist()
            columns.setdefault(one.entity_path, {}).setdefault(name, []).extend(rows)
    return columns


def test_what_is_logged(files, tmp_path):
    pytest.importorskip("rerun")
    words = ["--groundtruth", str(files.groundtruth), "--objects", str(files.objects)]
    path = tmp_path / "map.rrd"
    assert main(["view", str(files.results), *words, "--rerun", str(path)]) == 0
    columns = read(path)
    results = load_results(files.results)
    objects = columns["/world/objects"]
    (centers,) = objects["Ellipsoids3D:centers"]
    np.testing.assert_allclose(centers, results.objects.centers, atol=1e-6)
    (half_sizes,) = objects["Ellipsoids3D:half_sizes"]
    np.testing.assert_allclose(half_sizes, results.objects.semi_axes, rtol=1e-6)
    assert objects["Ellipsoids3D:labels"] == [["cup 10", "book 11", "lamp 12", "box 14", "cup 99"]]
    (strips,) = columns["/world/estimate"]["LineStrips3D:strips"]
    np.testing.assert_allclose(strips[0], results.poses[:, :3], atol=1e-6)
    assert len(columns["/world/true_objects"]["Ellipsoids3D:centers"][0]) == 6
    assert {"/world/odometry", "/world/truth", "/world/true_objects"} <= set(columns)
    camera = columns["/world/camera"]
    places = [row[0] for row in camera["Transform3D:translation"] if row]
    np.testing.assert_allclose(places, results.poses[:, :3], atol=1e-6)
    boxes = columns["/world/camera/boxes"]
    assert boxes["image"] == list(range(planted.POSES))
    corners = np.array(boxes["Boxes2D:centers"]) - np.array(boxes["Boxes2D:half_sizes"])
    expected = results.boxes.box[:, :2].reshape(planted.POSES, 5, 2) + 0.5
    np.testing.assert_allclose(corners, expected, atol=1e-3)
    assert len(columns["/world/camera/outlines"]["LineStrips2D:strips"]) == planted.POSES


def test_the_share_of_images_that_is_written_is_told(files, tmp_path):
    pytest.importorskip("rerun")
    shares = []
    write_rerun(build_scene(load_results(files.results)), tmp_path / "map.rrd", shares.append)
    np.testing.assert_allclose(shares, np.arange(1, planted.POSES + 1) / planted.POSES)


def test_without_the_sdk_it_says_what_is_missing(files, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["view", str(files.results), "--rerun", str(tmp_path / "map.rrd")]) == 2
    assert "pip install 'dqslam[rerun]'" in capsys.readouterr().err
    assert not (tmp_path / "map.rrd").exists()
