"""Rays to what does not move, and boxes that overlap: what the checks compute with."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera
from dqslam.inspection.rays import Views, inverted, residuals
from dqslam.inspection.tracks import overlap, overlap_ids
from dqslam.io import read_detections


def test_rays_by_hand():
    """Two meters ahead and 0.2 m aside of cameras that move sideways; one middle 500 px off."""
    camera = Camera(400, 400, 320, 240, 640, 480)
    x = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])
    poses = np.zeros((3, 5, 7))
    poses[..., 0], poses[..., 6] = x, 1
    middle = np.dstack([320 + 400 * (0.2 - x) / 2, np.full(5, 240.0)]).repeat(3, axis=0)
    there = np.ones((3, 5), dtype=bool)
    there[1, 4] = False  # a shorter track
    poses[2], middle[2] = poses[0, 0], middle[0, 0]  # one that stands still
    middle[0, 2, 1] += 500
    off = residuals(camera, Views(poses, middle, there))
    assert off[0, 2] == pytest.approx(500, abs=2)
    assert np.delete(off[0], 2).max() < 2
    np.testing.assert_allclose(off[1, :4], 0, atol=1e-9)
    assert np.isnan(off[1, 4])
    assert np.isnan(off[2]).all()
    behind = residuals(camera, Views(inverted(poses), middle, there))
    assert (behind[1, :4] == 1e4).all()


def test_inverted_twice_is_the_same():
    random = np.random.default_rng(0)
    poses = np.hstack([random.normal(0, 1, (9, 3)), Rotation.random(9, random).as_quat()])
    np.testing.assert_allclose(inverted(inverted(poses)), poses, atol=1e-14)
    turn = Rotation.from_quat(poses[:, 3:])
    np.testing.assert_allclose(turn.apply(inverted(poses)[:, :3]), -poses[:, :3], atol=1e-14)


def test_overlap_by_hand():
    boxes = np.array([[0.0, 0, 2, 2], [5, 5, 6, 6]])
    np.testing.assert_allclose(overlap(boxes, np.array([[1.0, 0, 3, 2]])), [[1 / 3], [0]])


def test_boxes_are_joined_by_overlap_within_their_class(tmp_path):
    rows = [
        "0,0,0,0,10,10,1,1,cup",
        "0,0,100,0,110,10,1,1,cup",
        "1,1,101,0,111,10,1,1,cup",
        "1,1,1,0,11,10,1,2,jar",
        "2,2,102,0,112,10,1,1,cup",
        "2,2,1,0,11,10,1,2,jar",
    ]
    path = tmp_path / "boxes.csv"
    header = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name"
    path.write_text("\n".join([header, *rows]))
    assert overlap_ids(read_detections(path), np.arange(6)).tolist() == [0, 1, 1, 2, 1, 2]
