"""Cuboids and cylinders in result files, in their evaluation and in PLY."""

import json
from dataclasses import replace

import numpy as np
import pytest

import planted_bodies as planted
from dqslam.evaluation import evaluate_results, fit_boxes
from dqslam.io import FileError, load_results, read_true_objects
from dqslam.io.ply import write_ply
from dqslam.io.results import read_map
from dqslam.io.trajectory import Trajectory


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("bodies") / "out"
    planted.write_bodies(path)
    return path


@pytest.fixture
def changed(folder, tmp_path):
    """Write map.json with an entry of its first object changed, or taken away by None."""

    def write(**entries):
        content = json.loads((folder / "map.json").read_text())
        for name, value in entries.items():
            if value is None:
                content["objects"][0].pop(name)
            else:
                content["objects"][0][name] = value
        path = tmp_path / "map.json"
        path.write_text(json.dumps(content))
        return path

    return write


def test_a_round_trip_is_exact(folder):
    estimate, objects = planted.make_bodies(), load_results(folder).objects
    assert objects.object_shapes == estimate.object_shapes
    np.testing.assert_array_equal(objects.is_body, [True, True, False])
    np.testing.assert_array_equal(objects.half_lengths, estimate.half_lengths)
    np.testing.assert_array_equal(objects.rotation_vectors[:2], estimate.landmarks[:2, 6:])
    assert np.isnan(objects.half_lengths[2]).all()
    np.testing.assert_array_equal(objects.log_half_lengths_sigmas[:2], [[0.1, 0.2, 0.3]] * 2)
    np.testing.assert_allclose(objects.volumes, estimate.volumes, rtol=1e-12)
    product = planted.HALF_LENGTHS.prod()
    np.testing.assert_allclose(
        objects.volumes, [8 * product, 2 * np.pi * product, 4 / 3 * np.pi * product]
    )
    np.testing.assert_allclose(objects.solids.factors, estimate.solids.factors, atol=1e-12)
    np.testing.assert_allclose(objects.ellipsoids, estimate.ellipsoids, atol=1e-9)


def test_each_object_says_its_shape(folder):
    objects = json.loads((folder / "map.json").read_text())["objects"]
    assert [one["shape"] for one in objects] == ["cuboid", "cylinder", "ellipsoid"]
    assert objects[0]["half_lengths"] == pytest.approx(planted.HALF_LENGTHS.tolist())
    assert "half_lengths" not in objects[2]
    # The semi-axes are those of the ellipsoid with the same moments, and so are their sigmas.
    assert objects[0]["semi_axes"] == pytest.approx(
        (np.sqrt(5 / 3) * planted.HALF_LENGTHS).tolist()
    )
    assert objects[0]["log_semi_axes_sigma"] == pytest.approx([0.1, 0.2, 0.3])


def test_a_map_without_shapes_has_ellipsoids(changed):
    assert read_map(changed(shape="ellipsoid")).object_shapes[0].name == "ELLIPSOID"
    assert read_map(changed(shape=None)).object_shapes[0].name == "ELLIPSOID"


def test_what_is_wrong_with_a_shape_is_named(changed):
    with pytest.raises(FileError, match="objects row 0: shape 'cone' is none of ellipsoid, cuboid"):
        read_map(changed(shape="cone"))
    needs = "objects row 0: a cuboid needs positive half_lengths and a rotation_vector"
    with pytest.raises(FileError, match=needs):
        read_map(changed(half_lengths=None))
    with pytest.raises(FileError, match=needs):
        read_map(changed(half_lengths=[0.1, -0.2, 0.3]))
    with pytest.raises(FileError, match=needs):
        read_map(changed(rotation_vector=None))
    with pytest.raises(FileError, match=r"row 0 half_lengths: expected shape \(3\)"):
        read_map(changed(half_lengths=[0.1, 0.2]))


def test_boxes_of_surfaces_fit_their_bodies(folder):
    fits = fit_boxes(load_results(folder))
    assert np.min(fits.overlap) > 0.985  # edges are rounded by 0.7 % of the sides at most
    sides = np.tile(np.ptp(fits.boxes.box.reshape(-1, 2, 2), axis=1), 2)
    assert np.max(np.abs(fits.predicted - fits.boxes.box) / sides) < 0.01


def test_an_estimate_that_is_the_truth_has_no_errors(folder, tmp_path):
    results = load_results(folder)
    (tmp_path / "objects.csv").write_text(planted.TRUE_OBJECTS)
    truth = Trajectory(results.timestamps, results.poses)
    found = evaluate_results(
        results, truth, objects=read_true_objects(tmp_path / "objects.csv"), match="id"
    )["objects"]
    assert found["matched"] == 3
    for pair in found["pairs"]:
        assert pair["center"] == pytest.approx(0.0, abs=1e-6)
        assert pair["size_relative"] == pytest.approx(0.0, abs=1e-6)
        assert pair["volume_ratio"] == pytest.approx(1.0, abs=1e-6)
        assert pair["orientation_deg"] == pytest.approx(0.0, abs=1e-3)
        assert pair["iou_3d"] == pytest.approx(1.0, abs=5e-3)


def test_errors_of_a_cuboid_by_hand(folder, tmp_path, changed):
    """One side is 20 % too long: of the three sides 0.2 / 3 in the mean, and of the volume 1.2."""
    results = load_results(folder)
    longer = (planted.HALF_LENGTHS * [1.2, 1.0, 1.0]).tolist()
    objects = read_map(changed(half_lengths=longer))
    results = replace(results, objects=objects)
    (tmp_path / "objects.csv").write_text(planted.TRUE_OBJECTS)
    truth = Trajectory(results.timestamps, results.poses)
    true_objects = read_true_objects(tmp_path / "objects.csv")
    pair = evaluate_results(results, truth, objects=true_objects, match="id")["objects"]["pairs"][0]
    assert pair["size_relative"] == pytest.approx(0.2 / 3, abs=1e-6)
    assert pair["volume_ratio"] == pytest.approx(1.2, abs=1e-6)
    assert pair["iou_3d"] == pytest.approx(1 / 1.2, abs=3e-3)


def test_ply_has_the_faces_of_bodies(folder, tmp_path):
    results = load_results(folder)
    write_ply(tmp_path / "map.ply", results, [(1, 2, 3)] * 3, (0, 0, 0))
    lines = (tmp_path / "map.ply").read_text().splitlines()
    start = lines.index("end_header") + 1
    vertices = [line.split() for line in lines[start : start + 8]]
    assert all(vertex[6] == "3" for vertex in vertices)  # the id of the cuboid
    corners = np.array(vertices)[:, :3].astype(float)
    local = planted.TURNS[0].inv().apply(corners - planted.CENTERS[0])
    np.testing.assert_allclose(np.abs(local), np.tile(planted.HALF_LENGTHS, (8, 1)), atol=2e-6)
    assert f"element vertex {8 + 64 + 482 + planted.POSES}" in lines
    assert f"element face {12 + 124 + 960}" in lines
