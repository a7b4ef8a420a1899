"""Where a camera is in a map: answers with their confidence, and reasons for none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.places.location.boxes import label_boxes
from dqslam.places.location.location import _probabilities
from dqslam.places.location.score import Matches
from dqslam.places.location.search import Places
from small_place import (
    AXES,
    CENTERS,
    LENS,
    NAMES,
    boxes_at,
    detections_of,
    pose_at,
    write_map,
)

SQUARE = np.array([[0.5, 0.5, 0.1], [-0.5, 0.5, 0.1], [-0.5, -0.5, 0.1], [0.5, -0.5, 0.1]])


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return dq.PlaceMap.of(dq.load_results(write_map(tmp_path_factory.mktemp("map") / "a")))


def apart(found, pose):
    """Return meters and radians between an answer and the truth."""
    turn = Rotation.from_quat(found.pose[3:]).inv() * Rotation.from_quat(pose[3:])
    return np.linalg.norm(found.pose[:3] - pose[:3]), turn.magnitude()


def test_exact_boxes_give_the_pose_and_the_objects(place):
    pose = pose_at(1.3, -2.2, 0.9)
    found = dq.locate(place, detections_of(boxes_at(pose)), LENS)
    meters, radians = apart(found, pose)
    assert meters < 1e-3
    assert radians < 1e-3
    assert found.confidence > 0.999
    np.testing.assert_array_equal(found.object_id, 10 + np.arange(len(NAMES)))


def test_the_covariance_covers_the_error(place):
    """The mean of d^T C^-1 d over noisy images is 6 at most, that of six degrees of freedom."""
    pose = pose_at(-1.8, 1.9, 1.4)
    nees = []
    for seed in range(20):
        boxes = boxes_at(pose, noise_px=1.0, seed=100 + seed)
        found = dq.locate(place, detections_of(boxes), LENS)
        rotation = Rotation.from_quat(found.pose[3:])
        turn = rotation.inv() * Rotation.from_quat(pose[3:])
        error = np.concatenate([rotation.inv().apply(pose[:3] - found.pose[:3]), turn.as_rotvec()])
        nees.append(error @ np.linalg.inv(found.covariance) @ error)
    assert 0.5 < np.mean(nees) < 8.0


def test_errors_with_a_long_tail_widen_the_covariance(place):
    boxes = detections_of(boxes_at(pose_at(-1.8, 1.9, 1.4), noise_px=1.0))
    wider = replace(place, sensor=replace(place.sensor, tail=2.0 * place.sensor.tail))
    usual, wide = (dq.locate(one, boxes, LENS) for one in (place, wider))
    np.testing.assert_array_equal(usual.pose, wide.pose)
    np.testing.assert_allclose(wide.covariance, 2.0 * usual.covariance, rtol=0.05)


def test_an_object_in_many_images_counts_once_for_the_confidence():
    """By hand: of 8 boxes of 4 objects, half of the margin of 20 over the rival counts."""
    none = np.zeros(0, dtype=np.int64)
    places = Places(
        poses=np.zeros((2, 7)),
        log_odds=np.array([30.0, 10.0]),
        covariance=np.zeros((2, 6, 6)),
        matches=Matches(none, none, none, none),
        missing=np.zeros(2, dtype=np.int64),
        log_elsewhere=-50.0,
    )
    best, rival = _probabilities(places, 8, 4)
    assert np.log(best / (1.0 - best)) == pytest.approx(1.3 + 0.36 * 10.0 - 2.3 * np.log(4.0))
    assert rival == pytest.approx(1.0 - best)
    once, _ = _probabilities(places, 4, 4)
    assert np.log(once / (1.0 - once)) == pytest.approx(1.3 + 0.36 * 20.0 - 2.3 * np.log(4.0))


def test_boxes_of_two_objects_in_many_images_are_too_few(place):
    poses = np.array([pose_at(0.3 * k, -2.2, 1.0) for k in range(4)])
    box = np.concatenate([boxes_at(pose)[:2] for pose in poses])
    boxes = detections_of(box, NAMES[:2] * 4, pose=np.repeat(np.arange(4), 2))
    found = dq.locate(place, boxes, LENS, odometry=poses)
    assert found.reason.startswith("too few: 8 of 8 boxes are of classes in the map")


def test_the_answer_moves_with_the_map(place, tmp_path):
    """A motion of all objects and of the cameras that made the map moves the pose alike."""
    pose, turn = pose_at(2.0, 1.0, 1.1), Rotation.from_euler("zyx", [0.7, 0.2, -0.4])
    shift = np.array([3.0, -5.0, 2.0])
    found = dq.locate(place, detections_of(boxes_at(pose)), LENS)
    moved = dq.PlaceMap(
        place.object_ids,
        place.class_names,
        np.array(
            [
                dq._core.ellipsoid_from_axes(
                    turn.apply(center) + shift, axes, (turn * Rotation.from_quat(own)).as_quat()
                )
                for center, axes, own in map(dq._core.axes_from_ellipsoid, place.ellipsoids)
            ]
        ),
        place.covariances,
        place.sensor,
        None,
        turn.apply(place.seen_from.reshape(-1, 3)).reshape(place.seen_from.shape),
    )
    there = dq.locate(moved, detections_of(boxes_at(pose)), LENS)
    np.testing.assert_allclose(there.pose[:3], turn.apply(found.pose[:3]) + shift, atol=2e-3)


def test_two_boxes_are_too_few(place):
    found = dq.locate(place, detections_of(boxes_at(pose_at(0, -2, 1))[:2], NAMES[:2]), LENS)
    assert not found.is_found
    assert found.reason.startswith("too few: 2 of 2 boxes are of classes in the map")
    with pytest.raises(ValueError, match="locate: no answer: too few"):
        _ = found.pose


def test_no_boxes_are_too_few(place):
    found = dq.locate(place, detections_of(np.zeros((0, 4)), ()), LENS)
    assert found.reason.startswith("too few: 0 of 0 boxes")
    assert found.candidates == ()


def test_a_symmetric_place_is_ambiguous(tmp_path):
    """Four equal objects in a square look the same from four sides."""
    names = ("bowl",) * 4
    folder = write_map(tmp_path / "square", SQUARE, names)
    # Spheres, as turned ellipsoids break the symmetry.
    place = dq.PlaceMap.of(dq.load_results(folder))
    spheres = np.array([dq._core.ellipsoid_from_axes(c, [0.1] * 3, [0, 0, 0, 1]) for c in SQUARE])
    place = dq.PlaceMap(
        place.object_ids,
        names,
        spheres,
        place.covariances,
        place.sensor,
        place.upright,
        place.seen_from,
    )
    pose = pose_at(2.0, 0.7, 1.2)
    box, _ = dq._core.project_to_boxes(dq.PoseModel.SE3, LENS, np.tile(pose, (4, 1)), spheres)
    found = dq.locate(place, detections_of(box, names), LENS)
    assert found.reason.startswith("ambiguous: ")
    probabilities = [one.probability for one in found.candidates[:4]]
    assert max(probabilities) < 0.25
    assert probabilities == pytest.approx([probabilities[0]] * 4, rel=0.05)
    quarter = Rotation.from_euler("z", 90, degrees=True)
    for one in found.candidates[:4]:
        copies = [(quarter**k).apply(pose[:3]) for k in range(4)]
        assert min(np.linalg.norm(one.pose[:3] - copy) for copy in copies) < 0.01


def test_an_image_of_another_place_has_no_answer(place):
    random = np.random.default_rng(3)
    for _ in range(10):
        centers = random.uniform([-1, -1, 0], [1, 1, 0.6], (len(NAMES), 3))
        boxes = boxes_at(pose_at(1.5, 2.0, 1.3), centers)
        assert not dq.locate(place, detections_of(boxes), LENS).is_found


def test_a_wrong_class_and_a_moved_object_are_left_out(place):
    pose = pose_at(-2.2, -0.8, 1.0)
    names = ("cup", "plant", *NAMES[2:])
    moved = CENTERS.copy()
    moved[3] += [0.5, -0.4, 0.0]
    found = dq.locate(place, detections_of(boxes_at(pose, moved), names=names), LENS)
    boxes = boxes_at(pose, moved)
    assert found.is_found
    assert apart(found, pose)[0] < 0.02
    assert found.object_id[3] == -1
    assert len(boxes) == len(found.object_id)


def test_the_right_label_among_several_is_used(place):
    """Each box may be of three classes, and the detector's first choice is wrong for four."""
    pose = pose_at(0.4, 2.4, 1.2)
    kinds = sorted(AXES)
    labels = []
    for row, name in enumerate(NAMES):
        other = [kind for kind in kinds if kind != name][:2]
        share = (0.3, 0.4, 0.3) if row < 4 else (0.6, 0.2, 0.2)
        labels.append(dict(zip((name, *other), share, strict=True)))
    names = tuple(max(one, key=one.get) for one in labels)
    boxes = detections_of(boxes_at(pose), names=names)
    found = dq.locate(place, boxes, LENS, labels=labels)
    assert found.is_found
    assert apart(found, pose)[0] < 0.01
    np.testing.assert_array_equal(found.object_id, 10 + np.arange(len(NAMES)))


def with_other_classes(boxes, names, share):
    """Give boxes their true classes as second ones, of this share of the confidence."""
    number = {name: one for one, name in boxes.class_names.items()}
    other = np.array([number[name] for name in names])
    other[other == boxes.class_id] = -1
    score = np.where(other < 0, 0.0, share)
    return replace(
        boxes,
        score=np.full(len(boxes), 1.0 - share),
        other_class_id=other[:, None],
        other_score=score[:, None],
    )


def test_other_classes_of_a_box_are_labels_by_their_scores(place):
    """They answer as the same names with weights, where the first classes alone do not."""
    pose = pose_at(0.4, 2.4, 1.2)
    wrong = ("book", "cup", "bowl", "plant", "lamp", "cup", "lamp", "book")
    first = detections_of(boxes_at(pose), names=wrong)
    assert not dq.locate(place, first, LENS).is_found
    found = dq.locate(place, with_other_classes(first, NAMES, 0.45), LENS)
    labels = [{a: 0.55, b: 0.45} for a, b in zip(wrong, NAMES, strict=True)]
    by_name = dq.locate(place, first, LENS, labels=labels)
    assert found.is_found
    assert apart(found, pose)[0] < 0.01
    np.testing.assert_allclose(found.pose, by_name.pose, rtol=0.0, atol=2e-3)


def test_other_classes_are_those_of_the_box_that_is_kept():
    """Of two boxes in one place, weights of all classes add up; -1 and a score of 0 are none."""
    box = np.array([[10.0, 10.0, 50.0, 60.0], [11.0, 10.0, 50.0, 60.0], [80.0, 80.0, 99.0, 99.0]])
    boxes = dq.Detections(
        pose=np.zeros(3, dtype=int),
        box=box,
        score=np.array([0.5, 0.7, 0.4]),
        class_id=np.array([0, 1, 2]),
        object_id=np.full(3, -1),
        class_names={0: "cup", 1: "bowl", 2: "lamp"},
        other_class_id=np.array([[1, 2], [2, -1], [0, -1]]),
        other_score=np.array([[0.2, 0.1], [0.3, 0.9], [0.0, 0.0]]),
    )
    labeled = label_boxes(boxes, 0, None)
    np.testing.assert_array_equal(labeled.row, [1, 2])
    assert labeled.labels[0] == pytest.approx({"bowl": 0.9, "lamp": 0.4, "cup": 0.5})
    assert labeled.labels[1] == {"lamp": 0.4}


def test_boxes_of_several_classes_in_one_place_are_one(place):
    pose = pose_at(0.4, 2.4, 1.2)
    boxes = np.repeat(boxes_at(pose), 2, axis=0)
    names = tuple(name for own in NAMES for name in (own, "lamp" if own != "lamp" else "cup"))
    found = dq.locate(place, detections_of(boxes, names=names), LENS)
    assert found.is_found
    assert np.sum(found.object_id >= 0) == len(NAMES)


def test_images_of_a_sequence_vote(place):
    """Two images with two boxes each have no answer alone, and one together."""
    poses = np.array([pose_at(2.0, -1.0, 1.2), pose_at(1.4, -1.8, 1.2), pose_at(0.5, -2.2, 1.2)])
    rows = np.array([[0, 1, 2], [3, 4, 5], [5, 6, 7]])
    box = np.concatenate([boxes_at(p)[r] for p, r in zip(poses, rows, strict=True)])
    names = tuple(NAMES[row] for row in rows.ravel())
    boxes = detections_of(box, names, pose=np.repeat([0, 1, 2], 3))
    # The frame of odometry is anywhere.
    away = np.tile([4.0, 3.0, 2.0, 0.5, 0.5, 0.5, 0.5], (3, 1))
    odometry = dq._core.compose(dq.PoseModel.SE3, away, poses)
    noise = dq.OdometryNoise(0.002, 0.001)
    found = dq.locate(place, boxes, LENS, odometry=odometry, odometry_noise=noise)
    assert found.is_found
    assert found.image == 2
    assert apart(found, poses[2])[0] < 0.01
    np.testing.assert_array_equal(found.object_id, 10 + rows.ravel())


def test_several_images_need_odometry(place):
    box = np.tile(boxes_at(pose_at(2.0, -1.0, 1.2)), (2, 1))
    boxes = detections_of(box, NAMES * 2, pose=np.repeat([0, 1], len(NAMES)))
    with pytest.raises(ValueError, match="boxes of 2 images, and no odometry between them"):
        dq.locate(place, boxes, LENS)
    with pytest.raises(ValueError, match="boxes.pose: 1 is no row of the 1 of odometry"):
        dq.locate(place, boxes, LENS, odometry=[[0, 0, 0, 0, 0, 0, 1]])
    with pytest.raises(ValueError, match="odometry row 1: quaternion is not of norm 1"):
        dq.locate(place, boxes, LENS, odometry=[[0, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 2]])


def test_an_array_of_probabilities_is_as_names_with_weights(place):
    """Columns are the classes by their numbers, also where these have gaps."""
    boxes = detections_of(boxes_at(pose_at(1.0, 2.1, 1.2)))
    numbers = {name: 10 * row + 3 for row, name in enumerate(sorted(set(NAMES), reverse=True))}
    boxes = replace(
        boxes,
        class_id=np.array([numbers[name] for name in NAMES]),
        class_names={number: name for name, number in numbers.items()},
    )
    columns = [boxes.class_names[number] for number in sorted(boxes.class_names)]
    table = np.random.default_rng(0).dirichlet(np.ones(len(columns)), len(NAMES))
    table[np.arange(len(NAMES)), [columns.index(name) for name in NAMES]] += 1.0
    names = [dict(zip(columns, row, strict=True)) for row in table]
    by_array = dq.locate(place, boxes, LENS, labels=table)
    by_name = dq.locate(place, boxes, LENS, labels=names)
    np.testing.assert_array_equal(by_array.pose, by_name.pose)
    assert by_array.confidence == by_name.confidence > 0.99


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.ones((2, 1)), r"labels: expected shape \(2, 2\)"),
        (np.array([[1.0, 0.0], [np.nan, 1.0]]), "labels row 1: not finite"),
        (np.array([[1.0, -0.1], [1.0, 1.0]]), "labels row 0: negative"),
        (np.array([[1.0, 0.0], [0.0, 0.0]]), "labels row 1: no class is possible"),
    ],
)
def test_arrays_that_are_no_probabilities_are_refused(place, table, message):
    boxes = detections_of(boxes_at(pose_at(0.0, -2.0, 1.0))[:2], ("cup", "bowl"))
    with pytest.raises(ValueError, match=message):
        dq.locate(place, boxes, LENS, labels=table)


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([{"cup": 1.0}], "labels: expected 2 rows, one per box, got 1"),
        ([{"cup": 1.0}, {}], "labels row 1: not weights of names"),
        ([{"cup": -1.0}, {"cup": 1.0}], "labels row 0: not weights of names"),
        ([{"cup": 1.0}, {"cup": 0.0}], "labels row 1: the weights sum to 0"),
    ],
)
def test_bad_labels_are_refused(place, labels, message):
    boxes = detections_of(boxes_at(pose_at(0, -2, 1))[:2], NAMES[:2])
    with pytest.raises(ValueError, match=message):
        dq.locate(place, boxes, LENS, labels=labels)


def test_a_confidence_is_between_0_and_1(place):
    boxes = detections_of(boxes_at(pose_at(0, -2, 1)))
    with pytest.raises(ValueError, match="min_confidence is 1, not between 0 and 1"):
        dq.locate(place, boxes, LENS, min_confidence=1.0)


def test_a_map_without_boxes_has_assumed_rates(tmp_path):
    folder = write_map(tmp_path / "bare", with_boxes=False)
    pose = pose_at(1.3, -2.2, 0.9)
    found = dq.locate(folder, detections_of(boxes_at(pose)), LENS)
    assert found.is_found
    assert apart(found, pose)[0] < 0.01
