"""Kinds, shapes and places of objects."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oracle
from dqslam import _core, load_scenario, simulate
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import true_assumptions

PAPER = load_scenario("paper")


def changed(scenario=PAPER, objects="ellipsoids", **world):
    """The scenario with some settings of its world replaced, checked as those of a file."""
    content = scenario.model_dump()
    content["world"] = content["world"] | world
    return Scenario.model_validate(content | {"objects": objects})


def proportioned(objects="ellipsoids", **values):
    shape = {"ratio": (1.0, 2.0, 4.0), "median_m": 0.3, "spread": 1.2, "orientation": "any"}
    return changed(objects=objects, proportions=shape | values)


def true_axes(scenario, seeds):
    for seed in seeds:
        for one in simulate(scenario, seed=seed)[1].ellipsoids:
            _, axes, turn = _core.axes_from_ellipsoid(one)
            order = np.argsort(axes)
            yield axes[order], Rotation.from_quat(turn).as_matrix()[:, order]


# --- shapes --------------------------------------------------------------------------------------


def test_proportions_are_kept_and_sizes_spread():
    sizes, directions = [], []
    for axes, turn in true_axes(proportioned(), range(40)):
        np.testing.assert_allclose(axes / axes[0], [1.0, 2.0, 4.0], rtol=1e-6)
        sizes.append(np.log(np.cbrt(axes.prod())))
        directions.append(turn[:, 2])
    assert np.exp(np.mean(sizes)) == pytest.approx(0.3, rel=0.03)
    assert np.std(sizes) == pytest.approx(np.log(1.2), rel=0.1)
    # Any direction is equally likely: the squares of its components are 1/3 each on average.
    np.testing.assert_allclose(np.mean(np.square(directions), axis=0), 1.0 / 3.0, atol=0.06)


def test_upright_objects_stand_on_their_third_axis():
    upright = proportioned(ratio=(1.0, 1.5, 6.0), orientation="upright")
    for _, turn in true_axes(upright, range(3)):
        np.testing.assert_allclose(np.abs(turn[:, 2]), [0.0, 0.0, 1.0], atol=1e-6)


def test_other_numbers_of_the_world_stay():
    np.testing.assert_array_equal(
        simulate(proportioned(), seed=3)[1].centers, simulate(PAPER, seed=3)[1].centers
    )


def test_the_true_size_prior_of_proportions():
    """Mean and deviation of log semi-axes: log 0.3 + log(ratio / 2), and both spreads."""
    prior = true_assumptions(proportioned()).size_prior
    axes = [np.log(axes) for axes, _ in true_axes(proportioned(), range(40))]
    assert prior.log_mean == pytest.approx(np.log(0.3))
    unlike = np.log(2.0) * np.sqrt(2.0 / 3.0)
    assert prior.log_sigma == pytest.approx(np.hypot(np.log(1.2), unlike))
    assert np.mean(axes) == pytest.approx(prior.log_mean, abs=0.03)
    assert np.std(axes) == pytest.approx(prior.log_sigma, rel=0.03)


def test_the_box_of_a_cuboid_bounds_its_corners():
    scenario = proportioned("cuboids")
    detector = scenario.detector.model_copy(update={"edge_sigma_px": 0.0, "min_side_px": 20.0})
    recording, truth = simulate(scenario.model_copy(update={"detector": detector}), seed=2)
    _, twins = simulate(proportioned(), seed=2)  # the ellipsoids with the same axes
    assert truth.ellipsoids is None
    for row, ellipsoid in enumerate(twins.ellipsoids):
        center, half, turn = _core.axes_from_ellipsoid(ellipsoid)
        assert truth.volumes[row] == pytest.approx(8.0 * half.prod())
        np.testing.assert_allclose(np.sort(truth.cuboids[row, 3:6]), np.sort(half), rtol=1e-6)
        np.testing.assert_array_equal(truth.cuboids[row, :3], truth.centers[row])
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        corners = center + (signs * half) @ oracle.quaternion_matrix(turn).T
        for index in np.flatnonzero(truth.box_object_id == row)[::17]:
            robot = oracle.se2_matrix(truth.poses[recording.detections.pose[index]])
            box = oracle.bounding_box(recording.camera, robot, corners)
            np.testing.assert_allclose(recording.detections.box[index], box, atol=1e-6)


@pytest.mark.parametrize("objects", ["ellipsoids", "cuboids"])
def test_tilted_objects_stand_on_the_table(objects):
    table = load_scenario("orbit")
    shape = {"ratio": (1.0, 2.0, 4.0), "median_m": 0.07, "spread": 1.2, "orientation": "any"}
    scenario = changed(table, objects, proportions=shape, lift_max_m=0.0)
    _, truth = simulate(scenario, seed=0)
    _, twins = simulate(changed(table, proportions=shape, lift_max_m=0.0), seed=0)
    for row, ellipsoid in enumerate(twins.ellipsoids):
        _, half, turn = _core.axes_from_ellipsoid(ellipsoid)
        up = np.abs(oracle.quaternion_matrix(turn)[2])
        height = up @ half if objects == "cuboids" else np.linalg.norm(up * half)
        assert truth.centers[row, 2] == pytest.approx(height)


def test_objects_take_turns_in_their_classes():
    recording, truth = simulate(changed(class_count=3), seed=0)
    assert truth.class_names[:4] == ("ellipsoid_1", "ellipsoid_2", "ellipsoid_3", "ellipsoid_1")
    boxes = recording.detections
    names = [boxes.class_names[number] for number in boxes.class_id.tolist()]
    assert names == [truth.class_names[row] for row in truth.box_object_id.tolist()]


# --- places --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["corridor_sideways", "corridor_forward"])
def test_objects_are_beside_a_corridor(name):
    scenario = load_scenario(name)
    world, across = scenario.world, []
    for seed in range(5):
        center = simulate(scenario, seed=seed)[1].centers
        assert len(center) == world.object_count
        assert -0.1 < center[:, 0].min() < center[:, 0].max() < 60.1
        across.append(center[:, 1])
    across = np.concatenate(across)
    assert np.abs(across).min() >= world.distance_min_m - 1e-6
    assert np.abs(across).max() <= world.distance_max_m
    assert (across > 0.0).mean() == pytest.approx(1.0 if world.sides == "left" else 0.5, abs=0.15)


@pytest.mark.parametrize("name", ["figure_of_eight", "loop_200m"])
def test_objects_beside_a_path_are_not_on_it(name):
    scenario = load_scenario(name)
    _, truth = simulate(scenario, seed=0)
    away = np.linalg.norm(truth.centers[:, None, :2] - truth.poses[:, :2], axis=2).min(axis=1)
    assert away.min() > scenario.world.distance_min_m - 1e-6
    assert away.max() <= scenario.world.distance_max_m


def test_objects_beside_a_flight_are_on_its_left():
    flight = load_scenario("flight")
    world = {"kind": "along_path", "distance_min_m": 1.0, "distance_max_m": 2.0, "sides": "left"}
    content = flight.model_dump()
    kept = {
        name: content["world"][name] for name in ("object_count", "side_mean_m", "side_sigma_m")
    }
    kept |= {name: content["world"][name] for name in ("side_min_m", "semi_axis_factor")}
    content["world"] = kept | world | {"height_sigma_m": 0.1}
    _, truth = simulate(Scenario.model_validate(content), seed=0)
    inside = (truth.centers[:, 0] / 10.0) ** 2 + (truth.centers[:, 1] / 6.0) ** 2
    assert (inside < 1.0).all()


def test_a_path_without_room_beside_it_is_refused():
    """The rectangle is 12.5 m wide: what is 8 m from one side is 4.5 m from the other one."""
    large = load_scenario("loop_200m")
    narrow = large.model_copy(update={"path": PAPER.path})
    scenario = changed(narrow, distance_min_m=8.0, distance_max_m=8.0)
    with pytest.raises(ValueError, match=r"world\.distance_min_m: hardly a place .* 8\.0 m from"):
        simulate(scenario, seed=0)


# --- settings that do not go together ------------------------------------------------------------


def test_sizes_are_given_once():
    with pytest.raises(ValueError, match="log_normal_size and proportions both give the sizes"):
        changed(proportioned(), log_normal_size={"median_m": 0.2, "spread": 1.5})


def test_cubes_have_no_proportions():
    with pytest.raises(ValueError, match='cubes have none; say objects = "cuboids"'):
        proportioned("cubes")


def test_distances_ascend():
    eight = load_scenario("figure_of_eight")
    with pytest.raises(ValueError, match="distance_min_m is above distance_max_m"):
        changed(eight, distance_min_m=6.0)
