"""Errors of edges, missing and false boxes, and ids that are switched for a while."""

from functools import cache

import numpy as np
import pytest

from dqslam import load_scenario, simulate
from dqslam.simulation.detector import switch_in_bursts
from dqslam.simulation.scenario import DetectorSettings

PAPER = load_scenario("paper")
SEEDS = range(10)


def detector(**values):
    return DetectorSettings(min_side_px=100.0, edge_sigma_px=1.0, **values)


@cache
def recorded(seed=0, **values):
    settings = PAPER.detector.model_copy(update=values)
    return simulate(PAPER.model_copy(update={"detector": settings}), seed=seed)


def noise(**values):
    """Errors of all edges over some seeds, outwards."""
    found = []
    for seed in SEEDS:
        exact, truth = recorded(seed, edge_sigma_px=0.0)
        noisy, also = recorded(seed, **values)
        np.testing.assert_array_equal(truth.box_object_id, also.box_object_id)
        found.append((noisy.detections.box - exact.detections.box) * [-1.0, -1.0, 1.0, 1.0])
    return np.vstack(found)


# --- edges ---------------------------------------------------------------------------------------


def test_tails_stretch_the_same_noise():
    gaussian, heavy = noise(), noise(edge_tail_dof=3.0)
    np.testing.assert_array_equal(np.sign(gaussian), np.sign(heavy))
    # Quantiles of Student t with three degrees of freedom: 0.7649 at 75 %, 5.841 at 99.5 %.
    assert np.quantile(heavy, 0.75) == pytest.approx(0.7649, abs=0.03)
    assert np.quantile(np.abs(heavy), 0.99) == pytest.approx(5.841, rel=0.1)
    assert np.quantile(np.abs(gaussian), 0.99) == pytest.approx(2.576, rel=0.05)


def test_a_bias_moves_every_edge_outwards():
    np.testing.assert_allclose(noise(edge_bias_px=3.0), noise() + 3.0, atol=1e-9)


def test_edges_on_whole_pixels():
    rounded = recorded(whole_pixels=True)[0].detections.box + 0.5
    np.testing.assert_array_equal(rounded, np.round(rounded))
    difference = noise(whole_pixels=True) - noise()
    assert np.abs(difference).max() <= 0.5 + 1e-9
    assert difference.std() == pytest.approx(1.0 / np.sqrt(12.0), rel=0.02)


@pytest.mark.parametrize(
    ("settings", "rms"),
    [
        ({}, 1.0),
        ({"edge_tail_dof": 3.0}, 3.0**0.5),
        ({"edge_tail_dof": 4.0, "edge_bias_px": -2.0}, 6.0**0.5),
        ({"whole_pixels": True}, (13.0 / 12.0) ** 0.5),
    ],
)
def test_the_root_mean_square_of_an_edge(settings, rms):
    assert detector(**settings).edge_rms_px == pytest.approx(rms)
    if "edge_tail_dof" not in settings:  # whose samples do not settle
        assert np.sqrt((noise(**settings) ** 2).mean()) == pytest.approx(rms, rel=0.02)


def test_a_box_that_noise_turns_inside_out_is_not_drawn():
    thin = load_scenario("plates")
    settings = thin.detector.model_copy(update={"edge_sigma_px": 30.0})
    recording, truth = simulate(thin.model_copy(update={"detector": settings}), seed=0)
    whole, _ = simulate(thin, seed=0)
    assert 0.5 * len(whole.detections) < len(recording.detections) < len(whole.detections)
    assert (recording.detections.box[:, :2] < recording.detections.box[:, 2:]).all()
    assert len(truth.box_object_id) == len(recording.detections) == len(recording.positions)


# --- missing and false boxes ---------------------------------------------------------------------


def test_some_boxes_are_missing_and_the_others_are_the_same():
    left = []
    for seed in SEEDS:
        whole, truth = recorded(seed)
        some, also = recorded(seed, missing_boxes=0.3)
        keys = {tuple(row) for row in whole.detections.box.tolist()}
        assert {tuple(row) for row in some.detections.box.tolist()} <= keys
        left.append(len(also.box_object_id) / len(truth.box_object_id))
    assert np.mean(left) == pytest.approx(0.7, abs=0.03)


@pytest.mark.parametrize("ids", ["known", "own"])
def test_the_share_of_false_boxes_is_what_was_asked_for(ids):
    for seed in SEEDS:
        right, _ = recorded(seed)
        recording, truth = recorded(seed, false_boxes=0.3, false_box_ids=ids)
        boxes, is_false = recording.detections, truth.box_object_id < 0
        assert is_false.mean() == pytest.approx(0.3, abs=0.002)  # of a whole number of boxes
        np.testing.assert_array_equal(boxes.box[~is_false], right.detections.box)
        np.testing.assert_array_equal(boxes.object_id[~is_false], right.detections.object_id)
        assert (np.diff(boxes.pose) >= 0).all()
        false = boxes.box[is_false]
        assert false.min() >= -0.5
        assert false[:, 2].max() <= 1279.5
        assert false[:, 3].max() <= 1023.5
        sizes = {
            tuple(row)
            for row in np.round(right.detections.box[:, 2:] - right.detections.box[:, :2], 6)
        }
        assert {tuple(row) for row in np.round(false[:, 2:] - false[:, :2], 6)} <= sizes
        np.testing.assert_array_equal(
            recording.positions.object_in_robot, right.positions.object_in_robot
        )


def test_false_boxes_of_known_objects_are_where_these_have_none():
    recording, truth = recorded(false_boxes=0.5)
    boxes = recording.detections
    pairs = list(zip(boxes.pose.tolist(), boxes.object_id.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs)
    right = truth.box_object_id >= 0
    assert set(boxes.object_id[~right].tolist()) <= set(boxes.object_id[right].tolist())
    assert len(np.unique(boxes.pose[~right])) > 100


def test_false_boxes_with_ids_of_their_own_have_one_each():
    recording, truth = recorded(false_boxes=0.2, false_box_ids="own")
    own = recording.detections.object_id[truth.box_object_id < 0]
    assert sorted(own.tolist()) == list(range(10, 10 + len(own)))


def test_there_may_be_no_place_for_false_boxes():
    with pytest.raises(ValueError, match=r"detector\.false_boxes: no place for \d+ boxes of known"):
        recorded(false_boxes=0.9)


# --- bursts of switched ids ----------------------------------------------------------------------


def test_bursts_are_runs_of_boxes_in_a_row_of_one_other_object():
    settings = detector(burst_share=0.3, burst_length=15)
    shown = np.tile([0, 1, 2], 400)
    random = np.random.default_rng(0)
    share = []
    for _ in range(30):
        said = switch_in_bursts(shown, shown, settings, random)
        for row in range(3):
            own = said[shown == row]
            edges = np.flatnonzero(np.diff(own) != 0) + 1
            runs = np.split(own, edges)
            # Between the first and the last, runs are of one burst, or of several in a row.
            for run in runs[1:-1]:
                assert len(run) % 15 == 0
            offsets = {int(edge) % 15 for edge in edges}
            assert len(offsets) <= 1
        share.append((said != shown).mean())
    assert np.mean(share) == pytest.approx(0.3, abs=0.04)


def test_bursts_leave_what_was_said_otherwise():
    settings = detector(burst_share=0.5)
    shown = np.tile([0, 1, 2], 100)
    said = np.roll(shown, 1)
    switched = switch_in_bursts(said, shown, settings, np.random.default_rng(0))
    same = switched == said
    assert 0.2 < same.mean() < 0.95
    one = np.zeros(50, dtype=np.int64)
    np.testing.assert_array_equal(
        switch_in_bursts(one, one, settings, np.random.default_rng(0)), one
    )


def test_bursts_of_a_drive_change_ids_only():
    right, truth = recorded()
    wrong, same = recorded(burst_share=0.4)
    np.testing.assert_array_equal(right.detections.box, wrong.detections.box)
    np.testing.assert_array_equal(truth.box_object_id, same.box_object_id)
    assert (wrong.detections.object_id != same.box_object_id).any()
    assert DetectorSettings(min_side_px=1.0, edge_sigma_px=1.0, burst_share=0.1).shows_wrong_objects
    assert not detector(missing_boxes=0.5, edge_bias_px=3.0).shows_wrong_objects
