"""Cuboids and cylinders from Python: told or found, their sizes, volumes and covariances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.recording import Recording, Truth
from dqslam.studies.paper.methods import Settings, assumptions_of, method_options
from dqslam.uncertainty import normalized_squares, true_state

NOISE = dq.BoxNoise(pixels=1.0, relative=0.0)


@pytest.fixture(scope="module")
def cubes() -> tuple[Recording, Truth]:
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=100)
    return replace(recording, positions=None), truth


@pytest.fixture(scope="module")
def solved(cubes: tuple[Recording, Truth]) -> tuple[dq.Graph, dq.Estimate]:
    graph = dq.build_graph(cubes[0], box_noise=NOISE, shapes=dq.Shape.CUBOID)
    estimate, summary = dq.solve(graph)
    assert summary.converged
    return graph, estimate


def test_cubes_have_the_volumes_of_cubes(
    cubes: tuple[Recording, Truth], solved: tuple[dq.Graph, dq.Estimate]
) -> None:
    estimate, truth = solved[1], cubes[1]
    as_ellipsoids, _ = dq.solve(dq.build_graph(cubes[0], box_noise=NOISE))
    report, before = (dq.evaluate(each, truth) for each in (estimate, as_ellipsoids))
    assert np.median(report.volume_relative_errors) < 0.03
    assert np.median(before.volume_relative_errors) > 0.08
    assert report.rmse_pos < before.rmse_pos
    assert estimate.is_body.all()
    assert set(estimate.object_shapes) == {dq.Shape.CUBOID}
    np.testing.assert_allclose(estimate.volumes, 8.0 * estimate.half_lengths.prod(axis=1))
    np.testing.assert_allclose(estimate.landmarks[:, :3], estimate.centers, atol=1e-12)


def test_an_ellipsoid_of_the_same_moments_stands_for_a_cuboid(
    solved: tuple[dq.Graph, dq.Estimate],
) -> None:
    estimate = solved[1]
    expected = np.sort(np.sqrt(5.0 / 3.0) * estimate.half_lengths, axis=1)[:, ::-1]
    np.testing.assert_allclose(estimate.semi_axes, expected, rtol=1e-9)


def test_covariances_are_those_of_the_bodies(
    cubes: tuple[Recording, Truth], solved: tuple[dq.Graph, dq.Estimate]
) -> None:
    graph, estimate = solved
    marginals = dq.marginal_covariances(graph, estimate)
    assert marginals.under_constrained == ()
    rows = [cubes[1].object_ids.tolist().index(each) for each in estimate.object_ids]
    errors = cubes[1].centers[rows] - estimate.centers
    assert 0.2 < np.median(normalized_squares(errors, marginals.centers)) < 3.0


def test_shapes_by_class_and_by_evidence(cubes: tuple[Recording, Truth]) -> None:
    recording, _ = cubes
    by_class = dq.build_graph(recording, shapes={"cube": dq.Shape.CUBOID})
    assert by_class.core.shapes == [dq.Shape.CUBOID] * len(by_class.object_ids)
    assert dq.build_graph(recording).core.shapes == []
    with pytest.raises(ValueError, match="shapes: no class 'box' in the recording, only: cube"):
        dq.build_graph(recording, shapes={"box": dq.Shape.CUBOID})
    found, _ = dq.solve(dq.build_graph(recording, box_noise=NOISE, shapes=dq.Shape.AUTO))
    often_seen = found.observations >= 20
    assert all(np.array(found.object_shapes)[often_seen] == dq.Shape.CUBOID)


def test_ellipsoids_are_not_taken_for_cuboids() -> None:
    scenario = dq.load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
    recording, _ = dq.simulate(scenario, seed=100)
    plain, _ = dq.solve(dq.build_graph(recording, box_noise=NOISE))
    found, _ = dq.solve(dq.build_graph(recording, box_noise=NOISE, shapes=dq.Shape.AUTO))
    assert found.object_shapes == ()
    np.testing.assert_allclose(found.ellipsoids, plain.ellipsoids)


def test_a_state_has_a_shape_for_each_object(solved: tuple[dq.Graph, dq.Estimate]) -> None:
    graph, estimate = solved
    state = dq.State(estimate.poses, estimate.landmarks, [dq.Shape.CUBOID])
    with pytest.raises(ValueError, match="start: shapes has 1 entries"):
        dq.solve(graph, start=state)
    everywhere = [dq.Shape.AUTO] * len(estimate.object_ids)
    with pytest.raises(ValueError, match="a state has no AUTO"):
        dq.solve(graph, start=dq.State(estimate.poses, estimate.landmarks, everywhere))


def test_what_knows_ellipsoids_only_refuses_shapes(solved: tuple[dq.Graph, dq.Estimate]) -> None:
    graph, estimate = solved
    needs = "shapes: cuboids and cylinders need the ellipsoid model"
    with pytest.raises(ValueError, match=needs):
        dq.solve(graph, dq.SolveOptions(landmark_model=dq.LandmarkModel.DUAL_QUADRIC))
    with pytest.raises(ValueError, match=needs):
        dq.solve(graph, dq.SolveOptions(residual=dq.Residual.BOX))
    with pytest.raises(ValueError, match="calibration: all objects must be ellipsoids"):
        dq.check_calibration(graph, estimate)


def test_a_saved_body_has_the_sigmas_of_its_lengths(
    tmp_path: Path, solved: tuple[dq.Graph, dq.Estimate]
) -> None:
    graph, estimate = solved
    marginals = dq.marginal_covariances(graph, estimate)
    dq.save_estimate(estimate, tmp_path / "out", marginals=marginals)
    saved = dq.load_results(tmp_path / "out").objects
    of_lengths = np.sqrt(np.diagonal(marginals.objects, axis1=1, axis2=2)[:, 3:6])
    order = np.argsort(-estimate.half_lengths, axis=1)
    np.testing.assert_allclose(
        saved.log_semi_axes_sigmas, np.take_along_axis(of_lengths, order, axis=1), rtol=1e-6
    )


def test_the_paper_is_told_true_sigmas_where_its_objects_have_their_own_shape() -> None:
    paper = dq.load_scenario("paper")
    told = assumptions_of(paper, Settings(bound=True, shape="cuboid"))
    assert told.box_noise.relative == 0.0
    assert assumptions_of(paper, Settings(bound=True)).box_noise == dq.BoxNoise()
    # Half of max(0.2, N(0.5, 0.3)): its logarithm, by a sample.
    sides = np.maximum(np.random.default_rng(1).normal(0.5, 0.3, 200_000), 0.2)
    assert told.size_prior.log_mean == pytest.approx(np.log(sides / 2).mean(), abs=0.01)
    assert told.size_prior.log_sigma == pytest.approx(np.log(sides).std(), abs=0.01)
    with pytest.raises(ValueError, match="no shapes but its quadrics"):
        Settings("paper", shape="cuboid")


@pytest.mark.parametrize("seed", [19, 222])
def test_a_body_that_has_bent_the_path_is_found_again(seed: int) -> None:
    # In these drives, one cube first ends tilted in a minimum of its own, which bends the path.
    paper = dq.load_scenario("paper")
    settings = Settings(bound=True, shape="cuboid")
    recording, truth = dq.simulate(paper, seed=seed)
    graph = assumptions_of(paper, settings).graph(replace(recording, positions=None))
    options = method_options(settings)
    _, summary = dq.solve(graph, options)
    _, from_truth = dq.solve(graph, options, start=true_state(graph, truth, options))
    assert summary.converged
    assert summary.final_cost < from_truth.final_cost + 0.2


def test_the_noise_of_few_boxes_tilts_no_cube() -> None:
    # A free tilt of the cube with eight boxes moves its center by six of its sigmas.
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=9)
    recording = replace(recording, positions=None)
    settings = Settings(bound=True, shape="cuboid")
    graph = assumptions_of(dq.load_scenario("paper"), settings).graph(recording)
    estimate, _ = dq.solve(graph)
    tilt = np.array([_tilt(vector) for vector in estimate.landmarks[:, 6:]])
    assert tilt.max() < 0.05
    rows = [truth.object_ids.tolist().index(each) for each in estimate.object_ids]
    errors = truth.centers[rows] - estimate.centers
    nees = normalized_squares(errors, dq.marginal_covariances(graph, estimate).centers)
    assert nees.max() < 5.5


def _tilt(rotation_vector: np.ndarray) -> float:
    """Return the angle between up and the axis of a cuboid that is nearest to it, radians."""
    up = Rotation.from_rotvec(rotation_vector).as_matrix()[2]
    return float(np.arccos(min(np.abs(up).max(), 1.0)))
