"""Runs that find out, or are told, which objects are cuboids and cylinders."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.cli import main
from dqslam.pipeline.shape_choice import choose_shapes
from dqslam.recording import Recording, Truth

OPTIONS = dq.RunOptions(shapes=dq.Shape.AUTO)


def simulated(objects: str, seed: int) -> tuple[Recording, Truth]:
    scenario = dq.load_scenario("paper").model_copy(update={"objects": objects})
    recording, truth = dq.simulate(scenario, seed=seed)
    return replace(recording, positions=None), truth


@pytest.fixture(scope="module")
def cubes() -> tuple[Recording, Truth]:
    return simulated("cubes", 102)


@pytest.fixture(scope="module")
def found(cubes: tuple[Recording, Truth]) -> dq.RunResult:
    return dq.run(cubes[0], OPTIONS)


def test_cubes_are_found_and_have_their_volumes(
    cubes: tuple[Recording, Truth], found: dq.RunResult
) -> None:
    plain = dq.run(cubes[0], replace(OPTIONS, shapes=None))
    assert plain.report["shapes"] is None
    assert not plain.estimate.is_body.any()
    often_seen = found.estimate.observations >= 10
    assert often_seen.sum() >= 5
    assert found.estimate.is_body[often_seen].all()
    assert set(np.array(found.estimate.object_shapes)[often_seen]) == {dq.Shape.CUBOID}
    before, after = (dq.evaluate(one.estimate, cubes[1]) for one in (plain, found))
    assert np.median(after.volume_relative_errors) < 0.03 < np.median(before.volume_relative_errors)
    assert after.rmse_pos < before.rmse_pos


def test_the_report_says_what_speaks_for_a_shape(found: dq.RunResult) -> None:
    shapes = found.report["shapes"]
    bodies = found.estimate.object_ids[found.estimate.is_body].tolist()
    assert shapes["shapes"] == {str(one): "cuboid" for one in bodies}
    assert all(shapes["log_likelihood_gain"][str(one)] > -1.0 for one in bodies)
    (rejected,) = set(found.estimate.object_ids.tolist()) - set(bodies)
    assert "boxes are too few to tell that it is a cuboid" in shapes["rejected"][str(rejected)]
    entry = found.report["objects"][0]
    assert entry["shape"] == "cuboid"
    assert entry["half_lengths_m"] == found.estimate.half_lengths[0].tolist()


def test_the_noise_of_bodies_is_what_their_boxes_show(found: dq.RunResult) -> None:
    """The detector's is 1 px, and ellipsoids need 2 px and 5 % of the side."""
    assert 1.0 < found.report["boxes"]["chi2_median"] < 5.0
    assert found.marginals is not None
    lengths = found.marginals.objects[found.estimate.is_body][:, 3:6, 3:6]
    assert np.sqrt(np.diagonal(lengths, axis1=1, axis2=2)).max() < 0.1


@pytest.mark.parametrize("told", [False, True])
def test_a_world_of_ellipsoids_stays_as_it_is(told: bool) -> None:
    recording, _ = simulated("ellipsoids", 205)
    noise = dq.BoxNoise(1.0, 0.0) if told else None
    plain = dq.run(recording, dq.RunOptions(box_noise=noise))
    same = dq.run(recording, replace(OPTIONS, box_noise=noise))
    np.testing.assert_array_equal(plain.estimate.ellipsoids, same.estimate.ellipsoids)
    np.testing.assert_array_equal(plain.estimate.poses, same.estimate.poses)
    assert same.report["shapes"]["shapes"] == {}


def test_known_poses_stay(cubes: tuple[Recording, Truth]) -> None:
    recording, truth = cubes
    steps = _core.between(_core.PoseModel.SE2, truth.poses[:-1], truth.poses[1:])
    at_truth = replace(
        recording, odometry=replace(recording.odometry, relative=steps, first_pose=truth.poses[0])
    )
    result = dq.run(at_truth, replace(OPTIONS, mode=dq.Mode.MAPPING))
    np.testing.assert_allclose(result.estimate.poses, truth.poses, atol=1e-9)
    assert result.estimate.is_body[result.estimate.observations >= 10].all()
    report = dq.evaluate(result.estimate, truth)
    assert np.median(report.volume_relative_errors) < 0.03
    assert result.marginals is not None
    sigmas = np.sqrt(np.diagonal(result.marginals.objects, axis1=1, axis2=2))
    assert np.isfinite(sigmas).all()
    assert (sigmas > 0.0).all()


def test_shapes_by_class(cubes: tuple[Recording, Truth], tmp_path) -> None:
    path = tmp_path / "shapes.toml"
    path.write_text('default = "auto"\n[classes]\ncube = "cuboid"\n')
    shapes = dq.load_shapes(path)
    assert shapes == dq.ClassShapes({"cube": dq.Shape.CUBOID}, dq.Shape.AUTO)
    result = dq.run(cubes[0], replace(OPTIONS, shapes=shapes))
    assert result.estimate.is_body.all()  # told, those with few boxes are cuboids, too
    with pytest.raises(ValueError, match="shapes: no class 'can' in the recording, only: cube"):
        dq.run(cubes[0], replace(OPTIONS, shapes={"can": dq.Shape.CYLINDER}))
    path.write_text('[classes]\ncube = "box"\n')
    with pytest.raises(ValueError, match=r"shapes.toml:2.*cube"):
        dq.load_shapes(path)


def test_a_shape_that_boxes_contradict_is_given_up() -> None:
    """Long ellipsoids, told to be cylinders: boxes that took no part say otherwise."""
    recording, truth = simulated("ellipsoids", 201)
    graph = dq.build_graph(recording, box_noise=dq.BoxNoise(1.0, 0.0))
    estimate, _ = dq.solve(graph)
    state = dq.State(estimate.poses, estimate.landmarks)
    solver = dq.SolveOptions(mode=dq.Mode.MAPPING, loss=dq.Loss.CAUCHY, loss_scale=2.0)
    told = [dq.Shape.CUBOID] * len(estimate.object_ids)
    choice = choose_shapes(graph, state, told, solver)
    given_up = choice.gains < -10.0  # not where there are too few boxes
    assert np.nanmax(choice.gains) < 0.0
    assert given_up.sum() >= 5
    np.testing.assert_array_equal(choice.is_body, ~given_up)
    assert choice.rejected == {}
    why = choice.given_up[int(graph.object_ids[given_up][0])]
    assert why.startswith("an ellipsoid predicts its boxes far better than a cuboid")


def test_the_command_finds_shapes_and_writes_them(tmp_path, capsys) -> None:
    folder = tmp_path / "recording"
    assert main(["simulate", "paper", "--seed", "105", "--out", str(folder), "-q"]) == 0
    files = ["--camera", str(folder / "camera.json"), "--odometry", str(folder / "odometry.txt")]
    files += ["--detections", str(folder / "boxes.csv"), "-q"]
    covariance = ["--odometry-covariance", str(folder / "odometry_covariance.csv")]
    out = tmp_path / "out"
    assert main(["run", *files, *covariance, "--shapes", "auto", "--out", str(out)]) == 0
    objects = json.loads((out / "map.json").read_text())["objects"]
    assert sum(one["shape"] == "cuboid" for one in objects) >= 6
    assert all(len(one["log_half_lengths_sigma"]) == 3 for one in objects if "half_lengths" in one)
    assert main(["run", *files, "--shapes", "cone", "--out", str(out)]) == 2
    assert "--shapes: 'cone' is none of ellipsoid, cuboid" in capsys.readouterr().err
