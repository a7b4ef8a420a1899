"""Maps of sessions: saved, continued, and the way found in them."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.problems import chain

import dqslam as dq
from dqslam import _core
from dqslam.assumptions import BoxNoise
from dqslam.io import FileError
from dqslam.online import OnlineSlam, StepBoxes, steps_of
from dqslam.online.maps import load_map
from small_place import CENTERS, NAMES, boxes_at, pose_at, write_map

NOISE = BoxNoise(pixels=1.0, relative=0.0)


@pytest.fixture(scope="module")
def problem():
    return chain(1, 10, 0, 0.1)


@pytest.fixture(scope="module")
def again(problem):
    """The first step after those of the map that sees five objects."""
    steps = list(steps_of(problem.recording))
    return next(row for row in range(300, 521) if len(steps[row].boxes.box) >= 5)


@pytest.fixture(scope="module")
def mapped(problem):
    """A session that knows its map from 300 steps."""
    slam = OnlineSlam(problem.recording.camera, box_noise=NOISE)
    for step in list(steps_of(problem.recording))[:300]:
        slam.add(step.odometry, step.boxes)
    slam.polish()
    return slam


@pytest.fixture(scope="module")
def saved(mapped, tmp_path_factory):
    directory = tmp_path_factory.mktemp("map")
    mapped.save(directory)
    return directory


def chi_square(pose, truth, covariance):
    error = _core.minus(dq.PoseModel.SE2, pose[None], truth[None])[0]
    return float(error @ np.linalg.solve(covariance, error))


def test_boxes_tell_where_the_robot_is(problem, mapped):
    steps = list(steps_of(problem.recording))
    scores = []
    for number in [row for row in range(300, 521, 10) if len(steps[row].boxes.box) >= 3]:
        boxes = steps[number].boxes
        found = mapped.relocalize(boxes)
        truth = problem.truth.poses[number]
        scores.append(chi_square(found.pose, truth, found.covariance))
        assert np.hypot(*(found.pose - truth)[:2]) < 0.3
        assert found.object_id.tolist() == list(boxes.object_id)
    assert len(scores) >= 10
    # Of 3 degrees of freedom; the map's own drift, common to its objects, adds a little.
    assert np.mean(scores) < 12.0


def test_classes_alone_tell_it_too(problem, mapped, again):
    boxes = list(steps_of(problem.recording))[again].boxes
    unknown = replace(boxes, object_id=np.full(len(boxes.box), -1))
    known = mapped.relocalize(boxes)
    found = mapped.relocalize(unknown)
    np.testing.assert_allclose(found.pose, known.pose, atol=1e-3)
    shown = found.object_id
    assert (shown[shown >= 0] == np.asarray(boxes.object_id)[shown >= 0]).all()


def test_a_camera_in_space_finds_its_way_by_classes(tmp_path):
    """The robot's pose has the mount of the camera; boxes of another place are refused."""
    pose, mount = pose_at(1.3, -2.2, 0.9), [0.1, -0.2, 0.3, 0.0, 0.0, np.sin(0.4), np.cos(0.4)]
    slam = OnlineSlam.load(
        write_map(tmp_path / "map"), robot_from_camera=mount, pose_model=dq.PoseModel.SE3
    )
    count = len(NAMES)
    found = slam.relocalize(StepBoxes(boxes_at(pose), np.full(count, -1), NAMES))
    back = _core.inverse(dq.PoseModel.SE3, np.array(mount)[None])
    robot = _core.compose(dq.PoseModel.SE3, pose[None], back)[0]
    np.testing.assert_allclose(found.pose[:3], robot[:3], atol=2e-3)
    assert abs(found.pose[3:] @ robot[3:]) == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_array_equal(found.object_id, 10 + np.arange(count))
    moved = CENTERS[np.random.default_rng(3).permutation(count)] * [1.3, 0.7, 2.0]
    elsewhere = StepBoxes(boxes_at(pose, moved), np.full(count, -1), NAMES)
    with pytest.raises(ValueError, match="relocalize: (too few|ambiguous): "):
        slam.relocalize(elsewhere)
    with pytest.raises(ValueError, match="relocalize: too few: 2 of 2 boxes are of classes"):
        slam.relocalize(StepBoxes(boxes_at(pose)[:2], [-1, -1], NAMES[:2]))


def test_too_few_boxes_are_refused(problem, mapped, again):
    boxes = list(steps_of(problem.recording))[again].boxes
    one = StepBoxes(boxes.box[:1], boxes.object_id[:1], boxes.class_name[:1])
    with pytest.raises(ValueError, match="1 boxes show objects of the map, 2 are needed"):
        mapped.relocalize(one)
    with pytest.raises(ValueError, match="0 boxes show objects of the map, 2 are needed"):
        mapped.relocalize(StepBoxes(boxes.box[:1], [9999]))


def test_boxes_of_nowhere_are_refused(mapped):
    ids = mapped.objects.object_ids[:4]
    boxes = StepBoxes(
        [[10, 10, 20, 900], [300, 10, 1200, 20], [600, 10, 610, 20], [0, 0, 5, 5]], ids
    )
    with pytest.raises(ValueError, match="no pose explains"):
        mapped.relocalize(boxes)


def test_a_symmetric_map_is_ambiguous():
    # Two equal spheres: from both sides they look the same.
    camera = chain(1, 2, 0, 0.1).recording.camera
    ellipsoids = np.array(
        [_core.ellipsoid_from_axes([x, 0.0, 1.0], [0.4, 0.4, 0.4], [0, 0, 0, 1]) for x in (-1, 1)]
    )
    pose = np.array([[0.0, -8.0, 0.0]])
    box, _ = _core.project_to_boxes(
        dq.PoseModel.SE2, camera, np.repeat(pose, 2, axis=0), ellipsoids
    )
    found = _core.relocalize(
        dq.PoseModel.SE2,
        camera,
        ellipsoids,
        np.repeat(1e-6 * np.eye(9).reshape(1, 81), 2, axis=0),
        box,
        np.repeat(np.eye(4).reshape(1, 16), 2, axis=0),
        np.zeros((2, 4), dtype=bool),
        [[0, 1], [0, 1]],
        2,
    )
    assert found.runner_up < found.chi_square + 1e-3
    places = np.array([found.pose, found.other])
    np.testing.assert_allclose(np.sort(places[:, 1]), [-8.0, 8.0], atol=1e-3)


@pytest.mark.parametrize(
    ("candidates", "fewest", "message"),
    [
        ([[], []], 0, "fewest must be at least 1"),
        ([[0]], 1, "candidates: need one list for each of 2 boxes"),
        ([[0], [1]], 1, "candidates: 1 is no object"),
        ([[], []], 1, "0 boxes show objects of the map, 1 are needed"),
    ],
)
def test_the_core_refuses_what_is_no_view(candidates, fewest, message):
    camera = chain(1, 2, 0, 0.1).recording.camera
    tables = np.zeros((1, 9)), np.eye(9).reshape(1, 81), np.tile([1.0, 2.0, 30.0, 40.0], (2, 1))
    noise, cut = np.repeat(np.eye(4).reshape(1, 16), 2, axis=0), np.zeros((2, 4), dtype=bool)
    with pytest.raises(ValueError, match=message):
        _core.relocalize(dq.PoseModel.SE2, camera, *tables, noise, cut, candidates, fewest)


def test_a_saved_map_comes_back(mapped, saved):
    known = load_map(saved)
    objects = mapped.objects
    order = np.argsort(objects.object_ids)
    assert known.object_ids == objects.object_ids[order].tolist()
    assert known.class_names == tuple(objects.class_names[row] for row in order)
    np.testing.assert_allclose(known.ellipsoids, objects.ellipsoids[order], atol=1e-6)
    assert (np.linalg.eigvalsh(known.covariances) > 0.0).all()
    assert np.sqrt(known.covariances[:, :3, :3].trace(axis1=1, axis2=2)).max() < 0.5


def test_a_saved_map_is_continued(problem, saved, again):
    steps = list(steps_of(problem.recording))
    slam = OnlineSlam.load(
        saved,
        robot_from_camera=problem.recording.camera.robot_from_camera,
        first_boxes=steps[again].boxes,
        box_noise=NOISE,
    )
    truth = problem.truth.poses
    assert np.hypot(*(slam.pose - truth[again])[:2]) < 0.2
    known = len(slam.objects)
    for step in steps[again + 1 : 480]:
        slam.add(step.odometry, step.boxes)
    error = np.hypot(*(slam.poses - truth[again:480])[:, :2].T)
    assert error.max() < 0.3
    assert np.isfinite(slam.polish().result().cost)
    assert np.hypot(*(slam.poses - truth[again:480])[:, :2].T).max() < 0.3
    assert len(slam.objects) == known  # all had been seen before


def test_a_map_needs_ellipsoids(tmp_path, saved):
    import shutil

    shutil.copytree(saved, tmp_path / "map")
    (tmp_path / "map" / "map.json").write_text('{"objects": []}')
    with pytest.raises(FileError, match="map.json: has no ellipsoid"):
        OnlineSlam.load(tmp_path / "map")
    with pytest.raises(FileError, match="no such directory"):
        OnlineSlam.load(tmp_path / "nowhere")
