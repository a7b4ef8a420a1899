"""Boxes that a detector drew twice on one thing, and things that it calls by several names."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import Detections, Recording, RunOptions, associate, load_scenario, run, simulate
from dqslam.association.repeats import find_repeats, repeats_in_image
from dqslam.metrics import box_iou

OTHERWISE = 7


def drawn(pose, box, score, class_id=None):
    names = {0: "cup", OTHERWISE: "bowl"}
    return Detections.from_xyxy(
        pose, box, score=score, class_id=class_id or [0] * len(pose), class_names=names
    )


def test_the_surest_box_of_an_image_counts():
    """Shifted by 10 of 100 px, boxes have an IoU of 90 / 110 = 0.82, by 20 of 80 / 120 = 0.67."""
    box = [[u, 0, u + 100, 100] for u in (0, 10, 20, 300, 10, 10)]
    boxes = drawn([0, 0, 0, 0, 1, 0], box, [0.6, 0.9, 0.7, 0.5, 1.0, 0.9])
    # The second is surest; the first and third overlap it, not each other. Pose 1 is another image.
    assert find_repeats(boxes).tolist() == [1, 1, 1, 3, 4, 1]
    assert find_repeats(boxes.select(np.array([0, 2, 3]))).tolist() == [0, 1, 2]
    assert find_repeats(boxes.select(np.zeros(0, dtype=int))).tolist() == []


def test_a_box_repeats_only_one_that_counts():
    box = np.array([[u, 0.0, u + 100.0, 100.0] for u in (0, 15, 30, 45)])
    assert box_iou(box[0], box[1]) == pytest.approx(85 / 115)
    # The second repeats the first. So the third overlaps none that counts; the fourth repeats it.
    assert repeats_in_image(box).tolist() == [0, 0, 2, 2]


def orbit(seed):
    recording, truth = simulate(load_scenario("orbit"), seed=seed)
    names = {**recording.detections.class_names, OTHERWISE: "otherwise"}
    boxes = replace(recording.detections, class_names=names)
    return replace(recording, detections=boxes), truth.box_object_id


def without_ids(recording: Recording):
    unknown = np.full(len(recording.detections), -1)
    return replace(recording, detections=replace(recording.detections, object_id=unknown))


def drawn_twice(recording: Recording, class_id=None, seed=0):
    """Draw 30 % of the boxes again, a little beside the first; return the row of each's first."""
    random = np.random.default_rng(seed)
    boxes = recording.detections
    boxes = replace(boxes, score=random.uniform(0.5, 1.0, len(boxes)))
    rows = np.flatnonzero(random.random(len(boxes)) < 0.3)
    again = boxes.select(rows)
    sigma = 1.0 + 0.02 * np.tile(again.box[:, 2:] - again.box[:, :2], (1, 2))
    jitter = random.normal(0.0, 1.0, sigma.shape) * sigma
    again = replace(again, box=again.box + jitter, score=random.uniform(0.5, 1.0, len(rows)))
    if class_id is not None:
        again = replace(again, class_id=np.full(len(rows), class_id))
    names = ("pose", "box", "score", "class_id", "object_id", "truncated")
    both = {name: np.concatenate([getattr(boxes, name), getattr(again, name)]) for name in names}
    return (
        replace(recording, detections=replace(boxes, **both)),
        np.concatenate([np.arange(len(boxes)), rows]),
    )


def purity(found, true):
    shown = (found >= 0) & (true >= 0)
    best = [np.bincount(true[shown & (found == one)]).max() for one in np.unique(found[shown])]
    return sum(best) / shown.sum()


@pytest.mark.parametrize("class_id", [None, OTHERWISE])
def test_what_is_drawn_twice_is_one_object(class_id):
    recording, thing = orbit(2)
    twice, rows = drawn_twice(without_ids(recording), class_id)
    result = run(twice, RunOptions())
    found = result.detections.object_id
    assert len(result.estimate.object_ids) == 8
    assert purity(found, thing[rows]) > 0.999
    assert np.mean(found >= 0) > 0.98  # a box that repeats another shows its object
    assert result.estimate.observations.sum() <= len(recording.detections)
    association = associate(twice)
    again = association.repeats
    assert again.sum() == pytest.approx(len(rows) - len(recording.detections), rel=0.05)
    assert not association.hidden[again].any()


def test_a_session_has_no_twins_either():
    recording, thing = orbit(1)
    twice, rows = drawn_twice(without_ids(recording), OTHERWISE)
    result = run(twice, RunOptions(), online=True)
    assert len(result.estimate.object_ids) == 8
    assert purity(result.detections.object_id, thing[rows]) > 0.99


@pytest.mark.parametrize("online", [False, True])
def test_what_is_called_by_several_names_is_one_object(online):
    recording, thing = orbit(1)
    boxes = recording.detections
    other = np.random.default_rng(1).random(len(boxes)) < 0.3
    class_id = np.where(other, OTHERWISE, boxes.class_id)
    renamed = replace(recording, detections=replace(boxes, class_id=class_id))
    result = run(without_ids(renamed), RunOptions(), online=online)
    assert len(result.estimate.object_ids) == 8
    assert purity(result.detections.object_id, thing) > 0.99
    assert "otherwise" not in result.estimate.class_names  # the name that most boxes give


@pytest.mark.parametrize("trust", [0.9, 1.0])
@pytest.mark.parametrize("names", ["several", "one"])
def test_ids_with_several_names_or_one_for_all(trust, names):
    recording, thing = orbit(1)
    boxes = recording.detections
    other = np.random.default_rng(1).random(len(boxes)) < 0.3
    class_id = np.where(other | (names == "one"), OTHERWISE, boxes.class_id)
    renamed = replace(recording, detections=replace(boxes, class_id=class_id))
    result = run(renamed, RunOptions(trust_ids=trust))
    assert len(result.estimate.object_ids) == 8
    assert purity(result.detections.object_id, thing) > 0.999
    assert ("otherwise" in result.estimate.class_names) == (names == "one")
