import json
from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.estimate import Estimate
from dqslam.io import (
    FileError,
    load_results,
    read_camera,
    read_trajectory,
    save_estimate,
    write_json,
)
from dqslam.recording import Detections
from dqslam.uncertainty import Marginals

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
    keys = "id class_name shape center semi_axes orientation_xyzw dual_quadric observations"
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


# --- boxes, covariances, and back -----------------------------------------------------------------

INLIERS = np.array([True, False])


def detections():
    """Return four boxes: used and fitting, of no object, held out, used but not fitting."""
    return Detections(
        pose=[0, 0, 1, 1],
        box=[[10.12345, 20, 30, 40], [1, 2, 3, 4], [5, 6, 7, 8], [-0.5, 9, 20, 479.5]],
        score=[0.9, 0.25, 1, 0.5],
        class_id=[2, 2, 7, 7],
        object_id=[3, -1, 8, 8],
        class_names={2: "cup", 7: 'tv "[red]", big'},
        truncated=np.array([[0, 0, 0, 0]] * 3 + [[1, 0, 0, 1]]),
    )


def test_a_name_of_two_lines_is_one_line_in_the_table(tmp_path):
    boxes = replace(detections(), class_names={2: "a\nb", 7: "c\r\nd"})
    save_estimate(estimate(inliers=INLIERS), tmp_path, detections=boxes, held_out=HELD_OUT)
    assert load_results(tmp_path).boxes.class_name == ("a b", "a b", "c d", "c d")


HELD_OUT = np.array([False, False, True, False])


def save_all(folder):
    marginals = Marginals(np.zeros((2, 6, 6)), np.array([np.diag(VARIANCES)] * 2), ())
    save_estimate(
        estimate(inliers=INLIERS, dropped={4: "too few"}),
        folder,
        detections=detections(),
        held_out=HELD_OUT,
        marginals=marginals,
    )


VARIANCES = np.arange(1.0, 10.0)


def test_everything_comes_back(tmp_path):
    save_all(tmp_path)
    found = load_results(tmp_path)
    for name in ("timestamps", "poses", "initial_poses"):
        np.testing.assert_array_equal(getattr(found, name), getattr(estimate(), name))
    assert found.report == {}
    assert repr(found) == f"Results('{tmp_path}', 2 poses, 2 objects)"
    boxes = found.boxes
    assert len(boxes) == 4
    np.testing.assert_array_equal(boxes.pose, [0, 0, 1, 1])
    np.testing.assert_allclose(boxes.box, detections().box, atol=5.1e-5)
    np.testing.assert_array_equal(boxes.truncated, detections().truncated)
    np.testing.assert_array_equal(boxes.score, [0.9, 0.25, 1, 0.5])
    np.testing.assert_array_equal(boxes.class_id, [2, 2, 7, 7])
    assert boxes.class_name == ("cup", "cup", 'tv "[red]", big', 'tv "[red]", big')
    np.testing.assert_array_equal(boxes.object_id, [3, -1, 8, 8])
    np.testing.assert_array_equal(boxes.inlier, [True, False, False, False])
    np.testing.assert_array_equal(boxes.held_out, HELD_OUT)
    objects = found.objects
    np.testing.assert_array_equal(objects.object_ids, [3, 8])
    assert objects.class_names == estimate().class_names == ("cup", 'tv "[red]"')
    np.testing.assert_array_equal(objects.observations, [12, 5])
    np.testing.assert_array_equal(objects.is_ellipsoid, [True, False])
    for name in ("object_ids", "observations", "centers", "semi_axes", "orientations"):
        np.testing.assert_array_equal(getattr(objects, name), getattr(estimate(), name))
    for name in ("ellipsoids", "dual_quadrics"):
        found_rows, rows = getattr(objects, name), getattr(estimate(), name)
        np.testing.assert_allclose(found_rows, rows, rtol=0.0, atol=1e-12)
    assert repr(objects) == "MapObjects(2 objects, 1 dropped)"
    np.testing.assert_array_equal(objects.center_covariances[0], np.diag([1.0, 2, 3]))
    assert np.isnan(objects.center_covariances[1]).all()
    assert objects.dropped == {4: "too few"}


def test_camera_comes_back(tmp_path):
    camera = _core.Camera(500.5, 501, 320, 240, 640, 480, distortion=[0.1, -0.2, 1e-3, 2e-3, 0.05])
    save_estimate(estimate(camera=camera), tmp_path)
    found = read_camera(tmp_path / "camera.json")
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        assert getattr(found, name) == getattr(camera, name)
    np.testing.assert_array_equal(found.distortion, camera.distortion)


def test_sigma_of_semi_axes_is_that_of_many_draws(tmp_path):
    """Draw shapes from the covariance of their parameters, and look at their axes."""
    random = np.random.default_rng(3)
    factor = 0.001 * random.normal(size=(9, 9))
    covariance = factor @ factor.T
    marginals = Marginals(np.zeros((2, 6, 6)), np.array([covariance, covariance]), ())
    save_estimate(estimate(), tmp_path, marginals=marginals)
    sigma = load_results(tmp_path).objects.log_semi_axes_sigmas[0]
    draws = random.multivariate_normal(estimate().ellipsoids[0], covariance, 4000)
    axes = np.array([_core.axes_from_ellipsoid(draw)[1] for draw in draws])
    np.testing.assert_allclose(sigma, np.log(axes).std(axis=0), rtol=0.05)


def test_an_object_that_nothing_determines_has_no_covariance(tmp_path):
    marginals = Marginals(np.zeros((2, 6, 6)), np.full((2, 9, 9), np.nan), ("object 3: free",))
    save_estimate(estimate(), tmp_path, marginals=marginals)
    assert "center_covariance" not in (tmp_path / "map.json").read_text()
    assert np.isnan(load_results(tmp_path).objects.log_semi_axes_sigmas).all()


def test_without_boxes_an_older_file_of_them_goes(tmp_path):
    save_all(tmp_path)
    save_estimate(estimate(), tmp_path)
    assert not (tmp_path / "boxes.csv").exists()
    assert load_results(tmp_path).boxes is None


def test_boxes_of_another_estimate_are_refused(tmp_path):
    message = "3 boxes have an object and are not held out, but the estimate is of 2"
    with pytest.raises(ValueError, match=message):
        save_estimate(estimate(inliers=INLIERS), tmp_path, detections=detections())


def test_an_empty_map_without_boxes_comes_back(tmp_path):
    nothing = detections().select(np.zeros(4, dtype=bool))
    empty = estimate(
        object_ids=np.zeros(0, dtype=int),
        class_names=(),
        observations=np.zeros(0, dtype=int),
        dual_quadrics=np.zeros((0, 9)),
        ellipsoids=np.zeros((0, 9)),
    )
    save_estimate(empty, tmp_path, detections=nothing)
    found = load_results(tmp_path)
    assert (len(found.objects), len(found.boxes)) == (0, 0)
    assert found.objects.ellipsoids.shape == (0, 9)


@pytest.mark.parametrize("name", ["trajectory.txt", "odometry.txt", "map.json", "camera.json"])
def test_missing_files_are_named(tmp_path, name):
    save_all(tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(FileError, match=f"{name}: no such file"):
        load_results(tmp_path)
    with pytest.raises(FileError, match="elsewhere: no such directory"):
        load_results(tmp_path / "elsewhere")


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("boxes.csv", "inlier,", "fits,", "boxes.csv:1: no column inlier"),
        ("boxes.csv", "0.25,10.", "0.26,10.", "boxes.csv:2: timestamp 0.26 is of no pose"),
        ("boxes.csv", ",30.0000,", ",10.0000,", "boxes.csv:2: empty box: x1 < x2, y1 < y2"),
        ("boxes.csv", "x1 y2", "x1 y3", "boxes.csv:5: truncated names 'y3', not one of x1 y1"),
        ("boxes.csv", ",3,1,0", ",3,2,0", "boxes.csv:2: inlier is 2, not 0 or 1"),
        ("boxes.csv", ",3,1,0", ",3,1", "boxes.csv:2: 11 fields, but 12 columns"),
        ("odometry.txt", "0.25 ", "0.5 ", "odometry.txt: its times are not those of"),
        ("map.json", '"objects"', '"things"', "map.json: has no list of objects"),
        ("map.json", '"center"', '"middle"', "map.json: objects row 0: missing center"),
        ("map.json", '"id": 8', '"id": 3', "map.json: id 3 occurs twice"),
        ("map.json", "      0.4,", "      -0.4,", "map.json: objects row 0: semi_axes and"),
        ("map.json", "      -2.0,", "      null,", "map.json: objects center row 0: not finite"),
        ("map.json", "{", "{{", "map.json:1: not JSON"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, name, old, new, message):
    save_all(tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    with pytest.raises(FileError, match=message):
        load_results(tmp_path)


def spd(seed, size):
    factor = np.random.default_rng(seed).normal(size=(size, size))
    return 1e-6 * factor @ factor.T


def test_covariances_of_poses_come_back(tmp_path):
    poses = np.array([spd(1, 6), np.full((6, 6), np.nan)])
    save_estimate(estimate(), tmp_path, marginals=Marginals(poses, np.zeros((2, 9, 9)), ()))
    found = load_results(tmp_path).covariances
    np.testing.assert_allclose(found[0], poses[0], rtol=1e-8, atol=1e-20)
    assert np.isnan(found[1]).all()
    save_estimate(estimate(), tmp_path)
    assert not (tmp_path / "covariance.csv").exists()
    assert np.isnan(load_results(tmp_path).covariances).all()


MOUNT = np.array([0.2, -0.1, 0.3, -0.5, 0.5, -0.5, 0.5])


@pytest.mark.parametrize("model", [_core.PoseModel.SE2, _core.PoseModel.SE3])
def test_covariance_of_the_camera_is_that_of_small_motions_of_the_robot(tmp_path, model):
    size = 3 if model == _core.PoseModel.SE2 else 6
    pose = np.array([[1.0, 2.0, 0.7]] if size == 3 else [[1.0, 2, 3, 0.5, 0.5, 0.5, 0.5]])
    poses = np.repeat(pose, 2, axis=0)
    camera = _core.Camera(500, 500, 320, 240, 640, 480, robot_from_camera=MOUNT)
    robot = estimate(pose_model=model, camera=camera, poses=poses, initial_poses=poses)
    covariance = spd(2, size)
    marginals = Marginals(np.array([covariance] * 2), np.zeros((2, 9, 9)), ())
    save_estimate(robot, tmp_path, marginals=marginals)

    def seen(robots):
        return _core.world_from_camera(model, camera, robots)

    tangents = 1e-5 * np.eye(size)
    moved = seen(_core.plus(model, np.repeat(pose, size, axis=0), tangents))
    still = seen(np.repeat(pose, size, axis=0))
    jacobian = _core.minus(_core.PoseModel.SE3, moved, still).T / 1e-5
    expected = jacobian @ covariance @ jacobian.T
    found = load_results(tmp_path).covariances[1]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * expected.max())


def test_covariances_of_other_poses_are_refused(tmp_path):
    marginals = Marginals(np.zeros((3, 6, 6)), np.zeros((2, 9, 9)), ())
    with pytest.raises(ValueError, match=r"marginals.poses: expected shape \(2, 6, 6\)"):
        save_estimate(estimate(), tmp_path, marginals=marginals)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.25,", "0.5,", r"covariance.csv:2: timestamp 0.5 is of no pose"),
        ("0.25,0", "0.25,-1", r"covariance.csv:2: a variance is negative"),
        ("0.25,0", "0.25,x", r"covariance.csv:2: c11 is 'x', not a number"),
    ],
)
def test_a_bad_line_of_covariances_is_named(tmp_path, old, new, message):
    save_all(tmp_path)
    path = tmp_path / "covariance.csv"
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(FileError, match=message):
        load_results(tmp_path)
