"""What boxes look like and other classes they may be of: the costs, and how they raise purity."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import Detections
from dqslam.association import associate
from dqslam.association.appearance import MOST_LOG_ODDS, Appearance, directions, learn_appearance
from dqslam.association.labels import Labels
from dqslam.association.refine import reassign
from dqslam.association.tracklets import link_tracklets
from dqslam.assumptions import BoxNoise, OdometryNoise
from dqslam.metrics import score_association
from dqslam.online import OnlineSlam, replay
from scenes import Thing, film, map_truly, orbit_poses
from test_association_tracklets import recording


def boxes(pose, embedding, class_id=None):
    """Return boxes that only differ in what they look like."""
    count = len(pose)
    return Detections(
        pose=pose,
        box=np.tile([10.0, 10.0, 20.0, 20.0], (count, 1)),
        score=np.ones(count),
        class_id=np.zeros(count, dtype=int) if class_id is None else class_id,
        object_id=np.full(count, -1),
        class_names={0: "cup", 1: "bowl"},
        embedding=embedding,
    )


def test_odds_are_those_of_two_normal_distributions():
    """ln N(x; 0.8, 0.2) - ln N(x; 0.2, 0.2) = 0.6 / 0.04 * (x - 0.5)."""
    looks = Appearance(same=0.8, different=0.2, spread=0.2)
    np.testing.assert_allclose(looks.log_odds(np.array([0.5, 0.6, 0.4])), [0.0, 1.5, -1.5])
    np.testing.assert_allclose(
        looks.log_odds(np.array([[1.0], [0.0]])), [[MOST_LOG_ODDS], [-MOST_LOG_ODDS]]
    )


def test_what_looks_say_is_learned_from_the_recording():
    """Two objects 60 degrees apart in each of 30 images: cosines are 1 and 0.5."""
    pose = np.repeat(np.arange(30), 2)
    two = np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    found, why = learn_appearance(boxes(pose, 7.0 * np.tile(two, (30, 1))))
    assert why == ""
    assert found.same == pytest.approx(1.0)
    assert found.different == pytest.approx(0.5)


@pytest.mark.parametrize("seed", range(3))
def test_vectors_that_say_nothing_are_not_used(seed):
    pose = np.repeat(np.arange(60), 5)
    vectors = np.random.default_rng(seed).normal(size=(300, 8))
    found, why = learn_appearance(boxes(pose, vectors))
    assert found is None
    assert why.startswith("appearance vectors do not tell objects apart")


def test_few_boxes_say_too_little():
    found, why = learn_appearance(boxes(np.array([0, 0, 1]), np.eye(3)))
    assert found is None
    assert "1 pairs of boxes in two images and 2 in one are too few" in why
    assert learn_appearance(boxes(np.zeros(3), np.zeros((0, 0)))) == (None, "")


def test_an_object_looks_like_the_mean_of_its_boxes():
    vectors = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, 0.0]])
    made = boxes(np.arange(3), vectors)
    labels = Labels.of(made, np.arange(3))
    labels.appearance = Appearance(same=1.0, different=0.0, spread=1.0)
    labels.add_object(np.array([0]))
    labels.add_object(np.array([1]))
    np.testing.assert_allclose(labels.look_odds(np.array([2]), np.array([0, 1])), [[0.5, -0.5]])
    labels.join_objects(0, 1)  # their mean has a cosine of 0.5 with each
    np.testing.assert_allclose(labels.look_odds(np.array([2]), np.array([0])), [[0.0]], atol=1e-12)
    labels.release(np.array([1]))
    np.testing.assert_allclose(labels.look_odds(np.array([2]), np.array([0])), [[0.5]])
    labels.release_all()
    np.testing.assert_array_equal(labels.look_sums, 0.0)


def test_two_that_swap_places_between_images_are_told_apart_by_their_looks():
    places = [(100.0, 130.0)] * 12 + [(130.0, 100.0)] * 12
    rows = [(pose, u, 100.0, 40.0) for pose, two in enumerate(places) for u in two]
    plain = recording(rows)
    looks = np.tile(np.eye(2), (24, 1))
    seen = replace(plain, detections=replace(plain.detections, embedding=looks))
    found, _ = learn_appearance(seen.detections)
    first, second = np.arange(24), np.arange(24, 48)
    wrong = link_tracklets(plain)
    assert wrong[first[0]] != wrong[second[0]]
    np.testing.assert_array_equal(link_tracklets(seen, appearance=found), [0, 1] * 24)


def crowd(seed):
    """Film twelve cups of one size on a table, 0.16 m apart; 30 % of the boxes are missing."""
    random = np.random.default_rng(seed)
    things = []
    for i in range(12):
        center = 0.16 * np.array([i % 4 - 1.5, i // 4 - 1.0, 0.0])
        center[:2] += random.uniform(-0.02, 0.02, 2)
        things.append(Thing(center, np.array([0.05, 0.05, 0.07])))
    noise = OdometryNoise(0.02, 0.01)
    return film(orbit_poses(40), things, noise=noise, seed=seed, missed=0.3, noise_px=1.5)


def noisy_looks(made, seed):
    """Return vectors (m, 16): a direction for each thing, with noise half as long."""
    random = np.random.default_rng(seed + 100)
    own = directions(random.normal(size=(len(made.things), 16)))
    return own[made.thing] + 0.12 * random.normal(size=(len(made.thing), 16))


@pytest.mark.parametrize(("seed", "least_gain"), [(0, 0.0), (1, 0.2)])
def test_looks_raise_purity_and_recall_among_objects_of_one_class(seed, least_gain):
    made = crowd(seed)
    detections = replace(made.recording.detections, embedding=noisy_looks(made, seed))
    with_looks = replace(made.recording, detections=detections)
    before, after = (
        score_association(
            detections.pose, associate(one, box_noise=BoxNoise(1.5, 0.02)).object_id, made.thing
        )
        for one in (made.recording, with_looks)
    )
    assert after.purity >= before.purity + least_gain
    assert after.purity >= 0.99
    assert after.recall >= before.recall + 0.1
    assert (after.found, after.split, after.invented) == (12, 0, 0)


@pytest.mark.parametrize("seed", [0, 1])
def test_looks_raise_purity_in_sessions(seed):
    made = crowd(seed)
    detections = replace(made.recording.detections, embedding=noisy_looks(made, seed))
    results = []
    for one in (made.recording, replace(made.recording, detections=detections)):
        slam = OnlineSlam(one.camera, trust_ids=0.9, box_noise=BoxNoise(1.5, 0.02))
        for _ in replay(slam, one):
            pass
        shown = np.concatenate(slam.assignments)
        results.append(score_association(detections.pose, shown, made.thing))
    before, after = results
    assert after.purity >= max(before.purity + 0.05, 0.95)
    assert after.recall >= before.recall + 0.1


def test_probabilities_of_classes_follow_the_confidences():
    made = replace(
        boxes(np.arange(3), np.zeros((0, 0))),
        score=np.array([0.6, 0.9, 0.0]),
        other_class_id=np.array([[1], [-1], [1]]),
        other_score=np.array([[0.2], [0.9], [0.0]]),
    )
    labels = Labels.of(made, np.arange(3))
    labels.add_object(np.array([1]))  # surely a cup
    np.testing.assert_allclose(labels.votes, [[1.0, 0.0]])
    probability = labels.class_probability(np.arange(3), np.array([0]))
    cup = 50 / 51  # of a box that is surely called so, for no class has less than 0.02
    np.testing.assert_allclose(probability[:, 0], [0.75 * cup + 0.25 * 0.02, cup, cup])
    labels.assign(np.array([0]), np.array([0]))
    np.testing.assert_allclose(labels.votes, [[1.75, 0.25]])
    np.testing.assert_array_equal(labels.box_counts, [2])
    # ln of 1 * 0.75 and of 0.02 * 0.25, the first box being a bowl with 0.02.
    odds = (1.0 * 0.75) / (0.02 * 0.25)
    probability = labels.class_probability(np.array([1]), np.array([0]))
    np.testing.assert_allclose(probability[0, 0], odds / (1 + odds))
    labels.release(np.array([0, 1]))
    np.testing.assert_allclose(labels.class_evidence, 0.0, atol=1e-12)


def share_assigned_rightly(made, detections):
    """Assign the boxes of a true map again, without tracklets, along a path that has drifted.

    Return which share of the assigned boxes is right.
    """
    made = replace(made, recording=replace(made.recording, detections=detections))
    scene = map_truly(made)
    scene.box_covariance = BoxNoise(25.0, 0.0).covariance(detections.box, made.recording.camera)
    labels, count = scene.labels, len(detections)
    labels.tracklets = len(labels.object_of_tracklet) + np.arange(count)
    labels.make_room(tracklets=len(labels.object_of_tracklet) + count)
    reassign(scene, 0.0)
    shown = labels.object_rows >= 0
    assert shown.mean() > 0.5
    return float(np.mean(labels.object_rows[shown] == made.thing[shown]))


@pytest.mark.parametrize("seed", range(3))
def test_other_classes_tell_neighbors_apart_where_a_detector_confuses_them(seed):
    """Every third box has the name of the other class; the detector was not sure then."""
    things = [
        replace(thing, class_id=1 if (i + i // 4) % 2 else 3)
        for i, thing in enumerate(crowd(seed).things)
    ]
    noise = OdometryNoise(0.01, 0.005)
    made = film(orbit_poses(40), things, noise=noise, seed=seed, missed=0.3)
    detections = made.recording.detections
    wrong = np.random.default_rng(seed).random(len(detections)) < 1 / 3
    right, other = detections.class_id, np.where(detections.class_id == 1, 3, 1)
    one_class = replace(
        detections, class_id=np.where(wrong, other, right), score=np.where(wrong, 0.5, 0.8)
    )
    two_classes = replace(
        one_class,
        other_class_id=np.where(wrong, right, other)[:, None],
        other_score=np.where(wrong, 0.45, 0.15)[:, None],
    )
    before = share_assigned_rightly(made, one_class)
    after = share_assigned_rightly(made, two_classes)
    assert after > before
