"""The problem of an estimate as a file."""

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.graph import Graph, solve
from dqslam.io import FileError
from dqslam.io.results import GRAPH_FILE, read_graph, write_graph


@pytest.fixture(scope="module")
def solved():
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording, scene_priors=_core.ScenePriors(support_sigma=0.05))
    options = _core.SolveOptions(loss=_core.Loss.CAUCHY, loss_scale=3.0)
    estimate, _ = solve(graph, options)
    return graph, estimate, options


def test_the_problem_is_the_same_and_its_solution_stays(tmp_path, solved):
    graph, estimate, options = solved
    write_graph(tmp_path / "graph.npz", graph, estimate, options)
    saved = read_graph(tmp_path / "graph.npz")
    assert repr(saved.options) == repr(options)
    assert saved.core.scene_priors.support_sigma == 0.05
    assert saved.class_names == graph.class_names
    np.testing.assert_array_equal(saved.core.boxes.covariance, graph.core.boxes.covariance)
    np.testing.assert_array_equal(saved.core.odometry.relative, graph.core.odometry.relative)
    np.testing.assert_array_equal(
        saved.core.camera.robot_from_camera, graph.core.camera.robot_from_camera
    )
    again = Graph(
        saved.core, saved.timestamps, saved.object_ids, saved.class_names, saved.observations
    )
    state = _core.State(saved.poses, saved.landmarks)
    found, _ = solve(again, saved.options, start=state)
    np.testing.assert_allclose(found.centers, estimate.centers, atol=1e-3)


def test_an_object_that_was_dropped_has_no_solution(tmp_path, solved):
    graph, estimate, options = solved
    kept = estimate.object_ids != 4
    less = dq.Estimate(
        **vars(estimate)
        | {"object_ids": estimate.object_ids[kept], "ellipsoids": estimate.ellipsoids[kept]}
    )
    write_graph(tmp_path / "graph.npz", graph, less, options)
    saved = read_graph(tmp_path / "graph.npz")
    assert saved.object_ids[np.isnan(saved.landmarks).all(axis=1)].tolist() == [4]


def test_shared_numbers_and_placements_are_kept(tmp_path, solved):
    graph, _, options = solved
    rules = dq.PlacementRules((dq.PlacementRule("on", None, "ground", 0.1),))
    placed, estimate, _, _ = dq.solve_with_placements(graph, rules, options)
    write_graph(tmp_path / "graph.npz", placed, estimate, options)
    saved = read_graph(tmp_path / "graph.npz").core
    assert len(saved.placements.kind) == len(estimate.object_ids)
    np.testing.assert_array_equal(saved.shared_sigma, placed.core.shared_sigma)
    np.testing.assert_array_equal(saved.size_prior.shared, placed.core.size_prior.shared)
    for name in ("kind", "object", "other", "shared", "distance", "sigma"):
        np.testing.assert_array_equal(
            getattr(saved.placements, name), getattr(placed.core.placements, name)
        )


def test_a_lens_and_measurements_are_kept(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=1)
    graph = dq.build_graph(recording)
    lens = dq.Lens("equidistant", (0.1, 0.01, 0.0, 0.0))
    graph = Graph(**vars(graph) | {"lens": lens})
    estimate, _ = solve(graph)
    write_graph(tmp_path / "graph.npz", graph, estimate, _core.SolveOptions())
    saved = read_graph(tmp_path / "graph.npz")
    assert saved.lens == lens
    assert [table.kind for table in saved.core.measurements] == ["position"]
    np.testing.assert_array_equal(
        saved.core.measurements[0].value, graph.core.measurements[0].value
    )


def test_what_is_no_problem_is_named(tmp_path, solved):
    path = tmp_path / "graph.npz"
    with pytest.raises(FileError, match=r"graph.npz: no such file"):
        read_graph(path)
    path.write_bytes(b"PK\x03\x04 not a zip")
    with pytest.raises(FileError, match=r"graph.npz: is no file of arrays"):
        read_graph(path)
    np.savez(path, poses=np.zeros(3))
    with pytest.raises(FileError, match=r"graph.npz: has no settings"):
        read_graph(path)
    graph, estimate, options = solved
    write_graph(path, graph, estimate, options)
    arrays = dict(np.load(path))
    np.savez(path, **arrays | {"object_ids": arrays["object_ids"][::-1]})
    with pytest.raises(FileError, match="object_ids do not ascend"):
        read_graph(path)
    np.savez(path, **arrays | {"boxes.object": arrays["boxes.object"] + 1000})
    with pytest.raises(FileError, match="no problem that dqslam has written"):
        read_graph(path)
    np.savez(path, **arrays | {"poses": arrays["poses"][1:]})
    with pytest.raises(FileError, match="poses has 252 rows, 253 are needed"):
        read_graph(path)


def test_save_estimate_keeps_it_on_request(tmp_path, solved):
    graph, estimate, _ = solved
    dq.save_estimate(estimate, tmp_path / "without")
    dq.save_estimate(estimate, tmp_path / "with", graph=graph)
    assert not (tmp_path / "without" / GRAPH_FILE).exists()
    assert read_graph(tmp_path / "with" / GRAPH_FILE).core.num_poses == 253
    dq.load_results(tmp_path / "with")  # the manifest knows it
