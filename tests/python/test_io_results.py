import json

import numpy as np
import pytest

from dqslam import _core
from dqslam.estimate import Estimate
from dqslam.io import FileError, read_trajectory, save_estimate, write_json

CENTER = [1.0, -2.0, 0.5]
AXES = [0.4, 0.2, 0.1]
TURN = [0.5, 0.5, 0.5, 0.5]


def estimate(**changes):
    """Return two poses and two objects, the second of which is no ellipsoid."""
    ellipsoid = _core.ellipsoid_from_axes(CENTER, AXES, TURN)
    identity = np.array([1.0, 0, 0, 0, 1, 0, 0, 1, 0])  # Q* = I: a shape of -I
    fields = {
        "pose_model": _core.PoseModel.SE3,
        "camera": _core.Camera(500, 500, 320, 240, 640, 480),
        "timestamps": np.array([0.25, 1311868164.363181]),
        "poses": np.array([[0, 0, 0, 0, 0, 0, 1.0], [1, 2, 3, 0, 1, 0, 0]]),
        "initial_poses": np.array([[0, 0, 0, 0, 0, 0, 1.0], [4, 5, 6, 0, 0, 1, 0]]),
        "object_ids": np.array([3, 8]),
        "class_names": ("cup", 'tv "[red]"'),
        "observations": np.array([12, 5]),
        "dual_quadrics": np.array([_core.dual_quadric_from_ellipsoid(ellipsoid), identity]),
        "ellipsoids": np.array([ellipsoid, np.full(9, np.nan)]),
    }
    return Estimate(**fields | changes)


def test_trajectories(tmp_path):
    save_estimate(estimate(), tmp_path / "new" / "folder")
    for name, end in (("trajectory.txt", [1, 2, 3, 0, 1, 0, 0]), ("odometry.txt", [4, 5, 6])):
        times, poses = read_trajectory(tmp_path / "new" / "folder" / name)
        np.testing.assert_array_equal(times, estimate().timestamps)
        np.testing.assert_array_equal(poses[1][: len(end)], end)


def test_trajectories_are_of_the_camera_not_the_robot(tmp_path):
    # On a robot that looks along its x axis: camera z forward, x right, y down; 0.3 m up.
    mount = [0.0, 0.0, 0.3, -0.5, 0.5, -0.5, 0.5]
    robot = estimate(
        pose_model=_core.PoseModel.SE2,
        camera=_core.Camera(500, 500, 320, 240, 640, 480, robot_from_camera=mount),
        poses=np.array([[0.0, 0, 0], [1, 2, np.pi / 2]]),
        initial_poses=np.zeros((2, 3)),
    )
    save_estimate(robot, tmp_path)
    _, poses = read_trajectory(tmp_path / "trajectory.txt")
    np.testing.assert_allclose(poses[:, :3], [[0, 0, 0.3], [1, 2, 0.3]], atol=1e-9)
    np.testing.assert_allclose(np.abs(poses[0, 3:]), 0.5, atol=1e-9)


def test_map(tmp_path):
    save_estimate(estimate(dropped={4: "too few"}), tmp_path)
    content = json.loads((tmp_path / "map.json").read_text())
    assert list(content) == ["objects", "dropped"]
    assert content["dropped"] == [{"id": 4, "reason": "too few"}]
    cup, tv = content["objects"]
    keys = "id class_name center semi_axes orientation_xyzw dual_quadric observations"
    assert list(cup) == list(tv) == keys.split()
    assert (cup["id"], cup["class_name"], cup["observations"]) == (3, "cup", 12)
    np.testing.assert_allclose(cup["center"], CENTER, rtol=1e-12)
    np.testing.assert_allclose(cup["semi_axes"], AXES, rtol=1e-12)
    # The axes and their orientation give the dual quadric back, whatever signs were chosen.
    again = _core.ellipsoid_from_axes(cup["center"], cup["semi_axes"], cup["orientation_xyzw"])
    quadric = _core.dual_quadric_matrix(_core.dual_quadric_from_ellipsoid(again))
    np.testing.assert_allclose(cup["dual_quadric"], quadric, atol=1e-12)
    assert quadric[3, 3] == 1


def test_no_ellipsoid_is_null_not_nan(tmp_path):
    save_estimate(estimate(), tmp_path)
    tv = json.loads((tmp_path / "map.json").read_text())["objects"][1]
    assert tv["class_name"] == 'tv "[red]"'
    assert tv["semi_axes"] is None
    assert tv["orientation_xyzw"] is None
    assert tv["center"] == [0, 0, 0]
    assert tv["dual_quadric"] == np.eye(4).tolist()


def test_json_has_no_nan(tmp_path):
    content = {"a": float("inf"), "b": [np.float64("nan"), np.int64(3)], "c": np.array([1.5])}
    write_json(tmp_path / "a.json", content)
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": None, "b": [None, 3], "c": [1.5]}


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    write_json(tmp_path / "a.json", {"old": 1})
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"new": object()})
    (tmp_path / "b").mkdir()
    with pytest.raises(FileError, match="b: cannot be written"):
        write_json(tmp_path / "b", {"new": 1})
    assert json.loads((tmp_path / "a.json").read_text()) == {"old": 1}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "b"]
