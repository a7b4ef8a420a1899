"""Merged maps: their objects, covariances, trajectories and files."""

import json

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.places import merge_graphs, read_landmarks
from planted_maps import landmarks, motion, moved, strewn, two_maps, write_csv

B_FROM_A = motion(2.0, (40.0, -70.0, 1.5))


def test_each_object_is_there_once_and_where_both_maps_say():
    a, b = two_maps(0, shared=10, others=5, sigma=0.0, b_from_a=B_FROM_A)
    small = np.tile(0.01**2 * np.eye(3), (15, 1, 1))
    merged = dq.merge(landmarks(a, covariances=small), landmarks(b, covariances=small))
    assert len(merged.landmarks) == 20
    np.testing.assert_allclose(merged.landmarks.centers[:15], a, atol=1e-6)
    back = moved(np.linalg.inv(B_FROM_A), b)
    ids = merged.parts[1].merged_ids
    rows = np.searchsorted(merged.landmarks.object_ids, ids)
    np.testing.assert_allclose(merged.landmarks.centers[rows], back, atol=1e-6)
    assert ids[::-1][:10].tolist() == (100 + np.arange(10)).tolist()


def test_the_covariance_of_an_object_of_both_is_half_of_that_of_one():
    a, b = two_maps(1, shared=40, others=4, sigma=0.02, b_from_a=B_FROM_A)
    given = np.tile(0.02**2 * np.eye(3), (44, 1, 1))
    merged = dq.merge(landmarks(a, covariances=given), landmarks(b, covariances=given)).landmarks
    variance = np.trace(merged.covariances, axis1=1, axis2=2) / 3.0
    assert 0.5 <= np.median(variance[:40]) / 0.02**2 < 0.65  # and the motion's
    np.testing.assert_allclose(variance[40:44], 0.02**2, rtol=0.5)
    assert (variance[44:] > 0.02**2).all()


def test_three_maps_are_merged_in_the_order_in_which_they_can_be():
    random = np.random.default_rng(3)
    world = strewn(random, 36)
    first, second, third = world[:14], world[22:], world[6:30]
    turned = motion(1.0, (3.0, 4.0, 0.0))
    merged = dq.merge(landmarks(first), landmarks(moved(turned, second)), landmarks(third))
    assert len(merged.landmarks) == 36
    np.testing.assert_allclose(merged.parts[2].merged_from_map, np.linalg.inv(turned), atol=1e-6)


def test_maps_of_other_places_are_named_and_nothing_is_written(tmp_path, capsys):
    a, b = two_maps(0, shared=10, others=5, sigma=0.01, b_from_a=B_FROM_A)
    other = strewn(np.random.default_rng(9), 15)
    paths = [
        str(write_csv(tmp_path / f"{name}.csv", centers))
        for name, centers in (("a", a), ("b", b), ("other", other))
    ]
    out = tmp_path / "out"
    assert main(["merge", *paths, "--out", str(out)]) == 3
    assert "other.csv cannot be aligned with the others" in capsys.readouterr().err
    assert not out.exists()
    assert main(["merge", *paths[:2], "--out", str(out)]) == 0
    assert len(json.loads((out / "map.json").read_text())["objects"]) == 20
    assert len(read_landmarks(out / "map.json")) == 20
    with pytest.raises(ValueError, match="1 map, at least 2"):
        dq.merge(landmarks(a))


@pytest.fixture(scope="module")
def solved():
    """The same drive twice, solved apart; the second has another frame after a cut."""
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph)
    return graph, estimate, dq.marginal_covariances(graph, estimate), truth


def test_folders_become_a_folder_that_sessions_continue(tmp_path, solved):
    _, estimate, marginals, _ = solved
    dq.save_estimate(estimate, tmp_path / "a", marginals=marginals)
    dq.save_estimate(estimate, tmp_path / "b", marginals=marginals)
    dq.merge(tmp_path / "a", tmp_path / "b", out=tmp_path / "both")
    one, both = load_results(tmp_path / "a"), load_results(tmp_path / "both")
    count = len(one.timestamps)
    assert len(both.timestamps) == 2 * count and (np.diff(both.timestamps) > 0.0).all()
    np.testing.assert_allclose(both.poses[count:, :3], one.poses[:, :3], atol=1e-6)
    np.testing.assert_allclose(both.covariances[:count], one.covariances, rtol=1e-6, atol=1e-12)
    assert (np.trace(both.covariances[count:], axis1=1, axis2=2) > 0.0).all()
    np.testing.assert_allclose(both.objects.centers, one.objects.centers, atol=1e-6)
    assert both.objects.observations.tolist() == (2 * one.objects.observations).tolist()
    assert both.objects.is_ellipsoid.all()
    slam = dq.OnlineSlam.load(tmp_path / "both")
    assert len(slam.objects.object_ids) == len(estimate.object_ids)
    described = json.loads((tmp_path / "both" / "merge.json").read_text())
    assert described["parts"][1]["time_shift_s"] == pytest.approx(count)


def test_graphs_are_solved_together(solved):
    graph, estimate, marginals, truth = solved
    joint = merge_graphs((graph, estimate), (graph, estimate))
    count = len(estimate.poses)
    assert joint.summary.converged
    assert joint.estimate.object_ids.tolist() == estimate.object_ids.tolist()
    assert joint.estimate.observations.tolist() == (2 * estimate.observations).tolist()
    # The same data twice: the same optimum, and the center as if its boxes had half the variance.
    np.testing.assert_allclose(joint.estimate.centers, estimate.centers, atol=0.05)
    np.testing.assert_allclose(joint.estimate.poses[count], estimate.poses[0], atol=0.05)
    error = np.linalg.norm(joint.estimate.centers - truth.centers[estimate.object_ids], axis=1)
    assert error.mean() < 0.2
    ratio = np.trace(joint.marginals.centers, axis1=1, axis2=2)
    ratio = ratio / np.trace(marginals.centers, axis1=1, axis2=2)
    assert 0.3 < np.median(ratio) < 1.0


def test_graphs_of_other_cameras_or_models_are_refused(solved):
    graph, estimate, _, _ = solved
    other, _ = dq.simulate(dq.load_scenario("orbit"), seed=0)
    second = dq.build_graph(other)
    with pytest.raises(ValueError, match="poses in SE2 and in SE3"):
        merge_graphs((graph, estimate), (second, estimate))
