"""Boxes of final ids that were refused along a drifting path."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import load_scenario, simulate
from dqslam.association import associate
from dqslam.association.refine import try_refused
from dqslam.assumptions import OdometryNoise
from dqslam.io import load_recording
from dqslam.metrics import position_error
from dqslam.simulation import perturb_odometry

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


def test_right_boxes_that_were_refused_come_back_and_straighten_the_path():
    """Without a last round, boxes are missing and the path is off by more than 0.5 m."""
    recording, truth = simulate(load_scenario("paper"), seed=0)
    found = associate(replace(recording, positions=None), trust=1.0, estimates_noise=False)
    true = truth.poses[found.keyframes]
    assert (found.scene.labels.object_rows >= 0).all()
    assert found.dropped == {}
    assert position_error(truth.pose_model, found.scene.poses, true) < 0.1


@pytest.fixture
def scene(files):
    recording, _ = load_recording(*files)
    recording = perturb_odometry(recording, NOISE, seed=0)
    return associate(recording, trust=1.0, estimates_noise=False).scene


def test_what_fits_stays_as_it_is(scene):
    before, boxes = scene.poses.copy(), scene.labels.object_rows.copy()
    try_refused(scene)
    np.testing.assert_array_equal(scene.labels.object_rows, boxes)
    np.testing.assert_allclose(scene.poses, before, atol=1e-3)
    assert scene.labels.dropped == {}


def test_an_object_whose_boxes_agree_on_nothing_is_left_out_with_a_reason(scene):
    """Its boxes jump about the image: none but those of two images may fit one place."""
    boxes = scene.recording.detections
    rows = np.flatnonzero(boxes.object_id == 101)[2:]
    number = scene.labels.object_rows[rows[0]]
    corner = np.random.default_rng(0).uniform(0.0, 400.0, (len(rows), 2))
    jumping = boxes.box.copy()
    jumping[rows] = np.hstack([corner, corner + 30.0])
    scene.recording = replace(scene.recording, detections=replace(boxes, box=jumping))
    try_refused(scene)
    assert list(scene.labels.dropped) == [number]
    assert scene.labels.dropped[number].startswith("one place explains ")
    assert (scene.labels.object_rows[boxes.object_id != 101] >= 0).all()
