"""Rules of where objects are, in a run."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core
from dqslam.metrics import true_rows
from dqslam.pipeline.placement_report import warn_of_placements

ON_A_PLANE = dq.PlacementRules((dq.PlacementRule("on", None, "plane", 0.01),))


@pytest.fixture(scope="module")
def table():
    """Look at objects on a table, from an arc of a quarter."""
    orbit = dq.load_scenario("orbit")
    scenario = orbit.model_copy(
        update={
            "path": orbit.path.model_copy(update={"turns": 0.25, "poses": 35}),
            "world": orbit.world.model_copy(update={"lift_max_m": 0.0}),
        }
    )
    recording, truth = dq.simulate(scenario, seed=3)
    return replace(recording, positions=None), truth


def height_error(estimate, truth):
    rows = true_rows(estimate.object_ids, truth)
    # Without what all have in common: the start of the path is a pose of the odometry.
    return (estimate.centers[:, 2] - truth.centers[rows, 2]).std()


@pytest.mark.parametrize("mode", [dq.Mode.SLAM, dq.Mode.MAPPING])
def test_objects_on_a_table(table, mode):
    recording, truth = table
    if mode == dq.Mode.MAPPING:
        recording = replace(
            recording, odometry=dq.Odometry.from_poses(truth.poses, covariance=np.eye(6))
        )
    options = dq.RunOptions(mode=mode, trust_ids=1.0)
    without = dq.run(recording, options)
    result = dq.run(recording, replace(options, placements=ON_A_PLANE))
    found = result.report["placements"]
    (plane,) = found["planes"]
    assert abs(plane["height_m"]) < 4 * plane["sigma_m"] < 0.2
    assert len(plane["object_ids"]) >= 6
    assert all(row["kind"] == "on" and row["other"] is None for row in found["placements"])
    assert height_error(result.estimate, truth) < height_error(without.estimate, truth)
    assert without.report["placements"] is None
    moved = np.abs(result.estimate.poses - without.estimate.poses).max()
    is_fixed = moved < 1e-12  # but for rounding
    assert is_fixed == (mode == dq.Mode.MAPPING)


def test_a_rule_without_force_leaves_the_estimate(table):
    recording, truth = table
    recording = replace(
        recording, odometry=dq.Odometry.from_poses(truth.poses, covariance=np.eye(6))
    )
    options = dq.RunOptions(mode=dq.Mode.MAPPING, trust_ids=1.0)
    loose = dq.PlacementRules((dq.PlacementRule("on", None, "plane", 100.0),))
    result = dq.run(recording, options)
    placed = dq.run(recording, replace(options, placements=loose)).estimate
    # Only a size prior about the mean of the sides still pulls.
    sigmas = np.sqrt(np.einsum("nii->ni", result.marginals.centers))
    assert np.all(np.abs(placed.centers - result.estimate.centers) < 0.2 * sigmas)
    np.testing.assert_array_equal(placed.poses, result.estimate.poses)


def in_the_frame_of_the_first_camera(recording, truth):
    """The same table in a world whose axes are those of the first camera."""
    first = _core.world_from_camera(dq.PoseModel.SE3, recording.camera, truth.poses[:1])
    inverse = _core.inverse(dq.PoseModel.SE3, first)
    back = np.repeat(inverse, len(truth.poses), axis=0)
    poses = _core.compose(dq.PoseModel.SE3, back, truth.poses)
    odometry = replace(recording.odometry, first_pose=poses[0])
    up = Rotation.from_quat(inverse[0, 3:]).apply([0.0, 0.0, 1.0])
    return replace(recording, odometry=odometry), up


def test_up_is_estimated_in_the_frame_of_a_camera(table):
    recording, up = in_the_frame_of_the_first_camera(*table)
    options = dq.RunOptions(trust_ids=1.0, placements=ON_A_PLANE)
    result = dq.run(recording, options)
    found = result.report["placements"]
    off = np.degrees(np.arccos(np.dot(found["up"], up)))
    assert off < 3.0 * found["up_sigma_deg"] < 15.0
    (plane,) = found["planes"]
    assert len(plane["object_ids"]) >= 6
    # Where it is told, it is not estimated.
    told = replace(ON_A_PLANE, up=tuple(up.tolist()))
    found = dq.run(recording, replace(options, placements=told)).report["placements"]
    assert found["up"] == pytest.approx(up)
    assert found["up_sigma_deg"] is None


def test_unknown_classes_are_named(table):
    rules = dq.PlacementRules((dq.PlacementRule("on", "unicorn", "plane"),))
    with pytest.raises(ValueError, match="no class 'unicorn' in the recording"):
        dq.run(table[0], dq.RunOptions(placements=rules))


def test_rules_that_do_not_hold_are_warned_of():
    row = {"kind": "on", "object": 1, "class_name": "cup", "other": None}
    rows = [row | {"holds": holds} for holds in (True, False, False)]
    assert warn_of_placements(None) == []
    assert warn_of_placements({"planes": [], "placements": rows[:2]}) == []
    assert warn_of_placements({"planes": [], "placements": rows}) == [
        "only 1 of 3 placements hold: are the rules, and up, right?"
    ]
    wide = {"planes": [], "placements": rows[:2], "up_sigma_deg": 11.6}
    (warning,) = warn_of_placements(wide)
    assert "the direction up is known to 12 degrees only" in warning
    assert warn_of_placements(wide | {"up_sigma_deg": 4.9}) == []
    assert warn_of_placements({"planes": [], "placements": []}) == [
        "no rule of placement holds for any object of the map"
    ]
