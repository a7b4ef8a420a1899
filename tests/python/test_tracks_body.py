"""Boxes of upright cuboids, against hand-computed ones and a dense sample of the surface."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera, _core
from dqslam.tracks.body import Views, predict_boxes

CAMERA = Camera(500.0, 510.0, 320.0, 240.0, 640, 480)
AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
HALF = np.array([2.0, 0.9, 0.75])
# Corners within this of each other are rounded to one [px].
ROUNDED_PX = 0.5


def test_the_box_of_a_cuboid_straight_ahead():
    """Foot 10 m ahead, 1 m below: the near face, at 8 m, has the outermost corners."""
    views = Views(CAMERA, AHEAD[None], np.zeros((1, 3)))
    box = predict_boxes(views, np.array([[10.0, 0.0, -1.0]]), np.zeros(1), HALF)
    # y is down: the foot at 1 m, the roof at -0.5 m, both nearest at 8 m.
    expected = [320 - 500 * 0.9 / 8, 240 - 510 * 0.5 / 8, 320 + 500 * 0.9 / 8, 240 + 510 / 8]
    np.testing.assert_allclose(box, [expected], atol=1e-6)


def test_the_box_is_that_of_the_surface():
    random, count = np.random.default_rng(0), 6
    turn = AHEAD @ Rotation.from_rotvec(0.2 * random.normal(size=(count, 3))).as_matrix()
    foot = [12.0, 0.0, -1.5] + random.normal(size=(count, 3))
    views = Views(CAMERA, turn, random.normal(size=(count, 3)))
    heading = random.uniform(-3, 3, count)
    boxes = predict_boxes(views, foot, heading, HALF)
    grid = np.linspace(-1.0, 1.0, 21)
    unit = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    for row in range(count):
        points = foot[row] + [0, 0, HALF[2]]
        points = points + (unit * HALF) @ Rotation.from_euler("z", heading[row]).as_matrix().T
        local = (points - views.position[row]) @ views.rotation[row]
        u = 320 + 500 * local[:, 0] / local[:, 2]
        v = 240 + 510 * local[:, 1] / local[:, 2]
        exact = [u.min(), v.min(), u.max(), v.max()]
        np.testing.assert_allclose(boxes[row], exact, atol=0.3 * ROUNDED_PX)


def test_tables_without_a_row_for_each_box_are_refused():
    with pytest.raises(ValueError, match="a view, a foot and a heading each"):
        _core.boxes_of_upright_cuboids(
            CAMERA, AHEAD, np.zeros((1, 3)), np.zeros((2, 3)), np.zeros(2), HALF
        )
