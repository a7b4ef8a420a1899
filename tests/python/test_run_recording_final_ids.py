"""Boxes of final ids that were refused along a drifting path."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import load_scenario, simulate
from dqslam.associate import associate
from dqslam.evaluate import position_error
from dqslam.io import OdometryNoise, load_recording
from dqslam.run_recording import perturb_odometry
from dqslam.run_recording.final_ids import judge_again

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


def refused(found):
    return int(np.sum(found.scene.box_object < 0))


def test_a_right_box_that_was_refused_comes_back_and_straightens_the_path():
    recording, truth = simulate(load_scenario("paper"), seed=0)
    found = associate(replace(recording, positions=None), trust=1.0, estimates_noise=False)
    true = truth.poses[found.keyframes]
    assert refused(found) > 0
    assert position_error(truth.pose_model, found.scene.poses, true) > 0.5
    again = judge_again(found)
    assert refused(again) == 0
    assert again.left_out == {}
    assert position_error(truth.pose_model, again.scene.poses, true) < 0.1


@pytest.fixture
def found(files):
    recording, _ = load_recording(*files)
    return associate(perturb_odometry(recording, NOISE, seed=0), trust=1.0, estimates_noise=False)


def test_what_fits_stays_as_it_is(found):
    before, boxes = found.scene.poses.copy(), found.scene.box_object.copy()
    again = judge_again(found)
    np.testing.assert_array_equal(again.scene.box_object, boxes)
    np.testing.assert_allclose(again.scene.poses, before, atol=1e-3)
    assert again.left_out == found.left_out == {}


def test_an_object_whose_boxes_agree_on_nothing_is_left_out_with_a_reason(found):
    """Its boxes jump about the image: none but those of two images may fit one place."""
    scene = found.scene
    boxes = scene.recording.detections
    rows = np.flatnonzero(boxes.object_id == 101)[2:]
    corner = np.random.default_rng(0).uniform(0.0, 400.0, (len(rows), 2))
    jumping = boxes.box.copy()
    jumping[rows] = np.hstack([corner, corner + 30.0])
    scene.recording = replace(scene.recording, detections=replace(boxes, box=jumping))
    again = judge_again(replace(found, left_out={7: "never seen"}))
    assert set(again.left_out) == {7, 101}
    assert again.left_out[7] == "never seen"
    assert again.left_out[101].startswith("one place explains ")
    assert (scene.box_object[boxes.object_id != 101] >= 0).all()


def test_without_objects_there_is_nothing_to_judge(found):
    nothing = replace(found, ids=np.zeros(0, dtype=np.int64))
    assert judge_again(nothing) is nothing
