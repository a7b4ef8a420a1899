"""Association as a whole: simulated scenes, errors of detectors and trackers, and properties."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import Detections, Odometry, PoseModel, Recording, _core
from dqslam.association import Association, associate, fill_in
from dqslam.association.association import _cut_alike
from dqslam.assumptions import BoxNoise, OdometryNoise
from dqslam.metrics import score_association
from scenes import Film, Thing, film, orbit_poses, street_poses, switched_ids, table_things
from test_association_consistency import circle

NOISE = OdometryNoise(0.02, 0.01)
BOXES = BoxNoise(1.0, 0.02)


def table(seed, turns=1.0, **options):
    """Film four cups and four books, with what detectors do wrong."""
    wrong = {"missed": 0.2, "false_positives": 0.5} | options
    count = round(40 * turns)
    return film(orbit_poses(count, turns), table_things(8), noise=NOISE, seed=seed, **wrong)


def all_poses(made: Film, found: Association):
    return fill_in(made.recording, found.keyframes, found.scene.poses)


def score(made: Film, found: Association):
    return score_association(made.recording.detections.pose, found.object_id, made.thing)


def assert_found(made: Film, found: Association, *, recall=0.9):
    """All objects are found, none invented or split, boxes are told apart, the path is better."""
    result = score(made, found)
    assert (result.found, result.missed, result.invented, result.split) == (8, 0, 0, 0)
    assert result.purity >= 0.98
    assert result.recall >= recall
    assert made.ate(all_poses(made, found)) < 0.5 * made.ate(made.odometry)
    assert found.dropped == {}
    # What the ids name is where it should be.
    for row in np.flatnonzero(found.object_ids >= 0):
        shown = made.thing[found.object_id == found.object_ids[row]]
        number = np.bincount(shown[shown >= 0]).argmax()
        error = found.scene.ellipsoids[row, :3] - made.centers[number]
        assert np.linalg.norm(error) < 0.08


@pytest.mark.parametrize("seed", range(3))
def test_boxes_without_ids(seed):
    made = table(seed)
    found = associate(made.recording, estimates_noise=False, box_noise=BOXES)
    assert_found(made, found)


def test_objects_are_known_again_on_the_second_time_round():
    made = table(2, turns=2.0, missed=0.1, false_positives=0.2)
    found = associate(made.recording, estimates_noise=False, box_noise=BOXES)
    assert_found(made, found)


def test_noise_is_estimated_as_well():
    """The first images belong to nothing as long as the default is believed, half of the truth."""
    made = table(0)
    found = associate(made.recording, box_noise=BOXES)
    assert_found(made, found, recall=0.85)
    noise = found.scene.odometry_noise
    assert noise.translation_m == pytest.approx(0.02, rel=0.5)
    assert noise.rotation_rad == pytest.approx(0.01, rel=0.5)


def test_ids_that_switch_are_cut_and_joined():
    made = table(0, false_positives=0.0)
    switched = made.with_ids(switched_ids(made))
    found = associate(switched, trust=0.9, estimates_noise=False, box_noise=BOXES)
    assert_found(made, found)


def test_final_ids_are_kept_whatever_the_boxes_say():
    made = table(0, false_positives=0.0)
    ids = made.thing.copy()
    ids[::17] = (ids[::17] + 1) % 8  # wrong, but final
    found = associate(made.with_ids(ids), trust=1.0, estimates_noise=False, box_noise=BOXES)
    np.testing.assert_array_equal(found.object_id, ids)
    assert set(found.object_ids.tolist()) == set(range(8))
    assert found.dropped == {}
    for row, name in enumerate(found.object_ids.tolist()):
        error = np.linalg.norm(found.scene.ellipsoids[row, :3] - made.centers[name])
        assert error < 0.08


def test_final_ids_that_are_not_in_the_map_are_named():
    made = table(0, false_positives=0.0)
    ids = made.thing.copy()
    few = np.flatnonzero(ids == 3)
    ids[few[3:]] = 2
    found = associate(made.with_ids(ids), trust=1.0, estimates_noise=False)
    assert 3 not in found.object_ids
    assert found.dropped[3] == "seen from 3 viewpoints, 4 are needed"


def drive(seed):
    """Drive past twelve parked cars; three come towards us."""
    random = np.random.default_rng(seed)
    car = np.array([0.9, 0.75, 2.15]) * (4 / np.pi) ** (2 / 3)
    things = []
    for i in range(6):
        for side in (-1, 1):
            place = [side * 4.5 + random.uniform(-0.3, 0.3), 1.0, 12.0 + 9 * i + 4 * (side > 0)]
            things.append(Thing(np.array(place), car * random.uniform(0.95, 1.05), class_id=2))
    for i in range(3):
        path = np.tile([-2.2, 1.0, 35.0 + 22 * i], (50, 1))
        path[:, 2] -= np.arange(50)
        things.append(Thing(path[0], car, class_id=2, path=path))
    noise = OdometryNoise(0.05, 0.002)
    return film(street_poses(50), things, noise=noise, missed=0.1, false_positives=0.2, seed=seed)


@pytest.mark.parametrize("seed", range(3))
def test_cars_that_come_towards_us_are_left_out(seed):
    made = drive(seed)
    found = associate(made.recording, estimates_noise=False)
    result = score(made, found)
    assert (result.invented, result.split) == (0, 0)
    assert result.purity >= 0.98
    shown = {
        name: int(np.bincount(made.thing[found.object_id == name].clip(min=0)).argmax())
        for name in found.object_ids[found.object_ids >= 0].tolist()
    }
    in_map = {number for name, number in shown.items() if name not in found.dropped}
    assert len(in_map & set(range(12))) >= 9
    assert {shown[name] for name in found.dropped} <= {12, 13, 14}
    assert len(found.dropped) >= 2
    for reason in found.dropped.values():
        assert "the usual one of a car: it moved" in reason
    assert made.ate(all_poses(made, found)) < made.ate(made.odometry)


def test_an_id_of_what_moves_is_left_out_and_said():
    path = circle(0.5, 0.2 * np.linspace(0, 2 * np.pi, 40))
    mover = Thing(path[0], np.full(3, 0.05), path=path)
    made = film(orbit_poses(40), [*table_things(7), mover], noise=NOISE)
    found = associate(made.with_ids(), trust=1.0, estimates_noise=False)
    assert list(found.dropped) == [7]
    assert "it moved" in found.dropped[7]
    assert made.ate(all_poses(made, found)) < 0.5 * made.ate(made.odometry)


# --- properties


def partition(object_id):
    """Return which boxes are together, whatever they are called."""
    return {frozenset(np.flatnonzero(object_id == name)) for name in set(object_id.tolist()) - {-1}}


def test_same_recording_same_bits():
    made = table(4)
    one, two = (associate(made.recording, box_noise=BOXES) for _ in range(2))
    np.testing.assert_array_equal(one.object_id, two.object_id)
    np.testing.assert_array_equal(one.scene.poses, two.scene.poses)
    np.testing.assert_array_equal(one.scene.ellipsoids, two.scene.ellipsoids)
    assert one.scene.odometry_noise == two.scene.odometry_noise


@pytest.mark.parametrize("all_rows", [False, True])
def test_the_order_of_boxes_does_not_matter(all_rows):
    """Within an image, or at all."""
    made = table(0)
    detections = made.recording.detections
    random = np.random.default_rng(0)
    order = random.permutation(len(detections))
    if not all_rows:
        order = order[np.argsort(detections.pose[order], kind="stable")]
    shuffled = replace(made.recording, detections=detections.select(order))
    straight = associate(made.recording, estimates_noise=False, box_noise=BOXES)
    other = associate(shuffled, estimates_noise=False, box_noise=BOXES)
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    assert partition(straight.object_id) == partition(other.object_id[back])
    np.testing.assert_allclose(straight.scene.poses, other.scene.poses, atol=2e-3)


def test_mapping_takes_the_odometry_for_the_truth():
    made = film(orbit_poses(40), table_things(8), missed=0.2, false_positives=0.5)
    found = associate(made.recording, mode=_core.Mode.MAPPING, box_noise=BOXES)
    np.testing.assert_allclose(all_poses(made, found), made.poses, atol=1e-9)
    result = score(made, found)
    assert (result.found, result.invented, result.split) == (8, 0, 0)
    assert result.purity >= 0.98
    assert found.scene.odometry_noise is None  # nothing says anything about it


def test_progress_rises_to_one():
    told = []
    associate(table(0).recording, estimates_noise=False, progress=told.append)
    assert told == sorted(told)
    assert told[0] > 0.0
    assert told[-1] == 1.0


@pytest.mark.parametrize("trust", [0.5, 0.0, -1.0, 1.01, float("nan")])
def test_trust_out_of_range(trust):
    with pytest.raises(ValueError, match="trust in ids is .*, not above 0.5 and at most 1"):
        associate(table(0).recording, trust=trust)


def test_a_final_id_that_is_missing_is_named_by_its_row():
    made = table(0, false_positives=0.0)
    ids = made.thing.copy()
    ids[23] = -1
    with pytest.raises(ValueError, match="detections.object_id row 23: final ids are needed"):
        associate(made.with_ids(ids), trust=1.0)


def test_nothing_at_rest_leaves_the_odometry():
    """Boxes anywhere: no object, and poses as the odometry has them."""
    made = table(0)
    random = np.random.default_rng(0)
    count = len(made.recording.detections)
    corner = random.uniform([0, 0], [500, 380], (count, 2))
    box = np.hstack([corner, corner + random.uniform(20, 90, (count, 2))])
    detections = replace(made.recording.detections, box=box)
    found = associate(replace(made.recording, detections=detections))
    assert np.all(found.object_id == -1)
    np.testing.assert_allclose(all_poses(made, found), made.odometry, atol=1e-9)


def test_a_robot_on_the_plane():
    """SE(2), a camera that looks forward, and the simulator's own loop."""
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=3)
    unnamed = replace(
        recording,
        positions=None,
        detections=replace(recording.detections, object_id=np.full(len(recording.detections), -1)),
    )
    found = associate(unnamed, estimates_noise=False)
    result = score_association(
        recording.detections.pose, found.object_id, recording.detections.object_id
    )
    assert recording.odometry.pose_model == PoseModel.SE2
    assert result.purity >= 0.98
    assert result.invented == 0
    poses = fill_in(unnamed, found.keyframes, found.scene.poses)
    odometry = _core.dead_reckon(PoseModel.SE2, poses[0], recording.odometry.relative)
    error = [
        np.linalg.norm((path - truth.poses)[:, :2], axis=1).mean() for path in (poses, odometry)
    ]
    assert error[0] < 0.5 * error[1]


def test_cuts_are_made_at_the_same_time_between_keyframes():
    """Boxes of one tracklet at poses 0 to 9, in any order; keyframes 0, 4, 8, cut before 8."""
    pose = np.array([9, 0, 1, 2, 3, 4, 5, 6, 7, 8])
    tracklet = np.full(10, 5)
    used = np.isin(pose, [0, 4, 8])
    cut = np.where(pose[used] == 8, 6, 5)
    expected = np.where(pose >= 8, 6, 5)
    np.testing.assert_array_equal(_cut_alike(tracklet, pose, used, cut), expected)


@pytest.mark.parametrize("names", [{1: "cup"}, {}])
def test_one_pose_and_no_boxes(names):
    none = Detections(
        pose=[], box=np.zeros((0, 4)), score=[], class_id=[], object_id=[], class_names=names
    )
    odometry = Odometry(PoseModel.SE3, np.eye(7)[6], np.zeros((0, 7)), np.zeros((0, 6, 6)))
    made = table(0)
    found = associate(Recording(made.recording.camera, [0.0], odometry, none))
    assert (found.object_id.shape, found.object_ids.shape) == ((0,), (0,))
    np.testing.assert_array_equal(found.keyframes, [0])
