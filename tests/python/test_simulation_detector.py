"""What the simulated detector does with boxes that leave the image, and with ids."""

from functools import cache

import numpy as np
import pytest

from dqslam import Camera, load_scenario, simulate
from dqslam.simulation.detector import associate, cut_at_border, is_detected
from dqslam.simulation.scenario import DetectorSettings

PAPER = load_scenario("paper")
CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)


def detector(**values):
    return DetectorSettings(min_side_px=100.0, edge_sigma_px=1.0, **values)


@cache
def recorded(seed=0, **values):
    settings = PAPER.detector.model_copy(update=values)
    return simulate(PAPER.model_copy(update={"detector": settings}), seed=seed)


def pairs(recording, truth):
    """The row of each detected pair of pose and object."""
    keys = zip(recording.detections.pose.tolist(), truth.box_object_id.tolist(), strict=True)
    return {key: row for row, key in enumerate(keys)}


# --- truncation ----------------------------------------------------------------------------------


def test_boxes_are_cut_where_they_leave_the_image():
    box, cut = cut_at_border(np.array([[-20.0, 3.0, 700.0, 479.5], [0, 0, 9, 9.0]]), CAMERA)
    np.testing.assert_array_equal(box, [[-0.5, 3.0, 639.5, 479.5], [0, 0, 9, 9]])
    np.testing.assert_array_equal(cut, [[True, False, True, False], [False] * 4])


@pytest.mark.parametrize(
    ("box", "discard", "clip"),
    [
        ([10.0, 10.0, 111.0, 50.0], True, True),
        ([10.0, 10.0, 110.0, 50.0], False, False),  # just not longer than 100 px
        ([-100.5, 10.0, 100.5, 50.0], False, True),  # half is seen, 101 px of it
        ([-101.5, 10.0, 98.5, 50.0], False, False),  # half is seen, but 99 px of it
        ([-251.0, 10.0, 101.0, 50.0], False, False),  # 102 of 352 px are less than 30 %
        ([-900.0, 10.0, -700.0, 50.0], False, False),
        ([np.nan] * 4, False, False),
    ],
)
def test_what_gives_a_box(box, discard, clip):
    for settings, expected in (
        (detector(), discard),
        (detector(truncation="clip", min_visible_fraction=0.3), clip),
    ):
        assert is_detected(np.array([[box]]), CAMERA, settings).tolist() == [[expected]]


def test_clipping_adds_cut_boxes_and_leaves_the_others():
    (whole, truth), (clipped, also) = recorded(), recorded(truncation="clip")
    rows, clipped_rows = pairs(whole, truth), pairs(clipped, also)
    assert rows.keys() < clipped_rows.keys()
    assert not whole.detections.truncated.any()
    cut = clipped.detections.truncated
    assert 0.1 < cut.any(axis=1).mean() < 0.3
    border = np.broadcast_to([-0.5, -0.5, 1279.5, 1023.5], cut.shape)
    np.testing.assert_array_equal(clipped.detections.box[cut], border[cut])
    same = [key for key in rows if not cut[clipped_rows[key]].any()]
    assert len(same) > 0.95 * len(rows)
    for key in same:
        np.testing.assert_array_equal(
            whole.detections.box[rows[key]], clipped.detections.box[clipped_rows[key]]
        )


# --- wrong ids -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["random", "structured"])
def test_the_share_of_wrong_ids_is_what_was_asked_for(kind):
    wrong = []
    for seed in range(20):
        recording, truth = recorded(seed, wrong_associations=0.2, wrong_association_kind=kind)
        wrong.append(recording.detections.object_id != truth.box_object_id)
        right = recorded(seed)[0].detections
        np.testing.assert_array_equal(truth.box_object_id, right.object_id)
        np.testing.assert_array_equal(recording.detections.box, right.box)
    # About 10000 boxes: 0.4 % standard error.
    assert np.concatenate(wrong).mean() == pytest.approx(0.2, abs=0.015)


def test_more_wrong_ids_keep_those_that_were_wrong():
    few, many = (recorded(3, wrong_associations=share)[0].detections for share in (0.1, 0.3))
    right = recorded(3)[1].box_object_id
    wrong = few.object_id != right
    assert 0 < wrong.sum() < (many.object_id != right).sum()
    np.testing.assert_array_equal(few.object_id[wrong], many.object_id[wrong])


CENTERS = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.5, 0, 0], [1.4, 0, 0]])


def test_structured_ids_are_those_of_the_nearest_detected_object():
    settings = detector(wrong_associations=0.4, wrong_association_kind="structured")
    pose, row = np.repeat(np.arange(500), 3), np.tile([0, 1, 2], 500)  # object 3 is never seen
    said = associate(pose, row, CENTERS, settings, np.random.default_rng(0))
    wrong = said != row
    assert wrong.mean() == pytest.approx(0.4, abs=0.05)
    np.testing.assert_array_equal(said[wrong], np.array([1, 2, 1])[row[wrong]])


def test_random_ids_are_any_other_detected_object():
    settings = detector(wrong_associations=0.4)
    pose, row = np.repeat(np.arange(3000), 3), np.tile([0, 1, 2], 3000)
    said = associate(pose, row, CENTERS, settings, np.random.default_rng(0))
    counts = np.bincount(3 * row + said, minlength=9).reshape(3, 3) / 3000
    np.testing.assert_allclose(counts, 0.2 + 0.4 * np.eye(3), atol=0.03)


def test_one_object_cannot_be_taken_for_another():
    settings = detector(wrong_associations=0.4)
    row = np.zeros(50, dtype=np.int64)
    said = associate(np.arange(50), row, CENTERS, settings, np.random.default_rng(0))
    np.testing.assert_array_equal(said, row)


def test_relative_positions_keep_their_object():
    (right, _), (wrong, _) = recorded(5), recorded(5, wrong_associations=0.4)
    np.testing.assert_array_equal(right.positions.object_id, wrong.positions.object_id)
    np.testing.assert_array_equal(right.positions.object_in_robot, wrong.positions.object_in_robot)
