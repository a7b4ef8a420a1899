"""Boxes of upright cuboids, against hand-computed ones and a dense sample of the surface."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import Camera
from dqslam.tracks.body import ROUNDED_PX, Views, predict_boxes

CAMERA = Camera(500.0, 510.0, 320.0, 240.0, 640, 480)
AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
HALF = np.array([2.0, 0.9, 0.75])


def views(rotation=AHEAD, position=(0.0, 0.0, 0.0), count=1):
    return Views(CAMERA, np.tile(rotation, (count, 1, 1)), np.tile(position, (count, 1)))


def test_the_box_of_a_cuboid_straight_ahead():
    """Foot 10 m ahead, 1 m below: the near face, at 8 m, has the outermost corners."""
    seen = predict_boxes(views(), np.array([[10.0, 0.0, -1.0]]), np.zeros(1), HALF)
    # y is down: the foot at 1 m, the roof at -0.5 m, both nearest at 8 m.
    expected = [320 - 500 * 0.9 / 8, 240 - 510 * 0.5 / 8, 320 + 500 * 0.9 / 8, 240 + 510 / 8]
    np.testing.assert_allclose(seen.box, [expected], atol=1e-12)
    assert seen.in_front.all() and seen.is_whole.all()
    # 1 m farther left moves both sides by f / 8, 1 m higher both ends up.
    np.testing.assert_allclose(seen.by_place[0, [0, 2], 1], -500 / 8)
    np.testing.assert_allclose(seen.by_place[0, [1, 3], 2], -510 / 8)


def drawn(seed, count=6):
    random = np.random.default_rng(seed)
    turn = AHEAD @ Rotation.from_rotvec(0.2 * random.normal(size=(count, 3))).as_matrix()
    foot = [12.0, 0.0, -1.5] + random.normal(size=(count, 3))
    return Views(CAMERA, turn, random.normal(size=(count, 3))), foot, random.uniform(-3, 3, count)


def test_the_box_is_that_of_the_surface():
    seen_from, foot, heading = drawn(0)
    seen = predict_boxes(seen_from, foot, heading, HALF)
    grid = np.linspace(-1.0, 1.0, 21)
    unit = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    for row in range(len(foot)):
        turn = Rotation.from_euler("z", heading[row]).as_matrix()
        points = foot[row] + [0, 0, HALF[2]] + (unit * HALF) @ turn.T
        local = (points - seen_from.position[row]) @ seen_from.rotation[row]
        u = 320 + 500 * local[:, 0] / local[:, 2]
        v = 240 + 510 * local[:, 1] / local[:, 2]
        exact = [u.min(), v.min(), u.max(), v.max()]
        np.testing.assert_allclose(seen.box[row], exact, atol=0.3 * ROUNDED_PX)


def test_derivatives_are_those_of_small_differences():
    seen_from, foot, heading = drawn(1)
    seen, step = predict_boxes(seen_from, foot, heading, HALF), 1e-6

    def difference(moved):
        return (moved(step).box - moved(-step).box) / (2 * step)

    for axis, unit in enumerate(np.eye(3)):
        by_foot = difference(
            lambda s, e=unit: predict_boxes(seen_from, foot + s * e, heading, HALF)
        )
        np.testing.assert_allclose(seen.by_place[..., axis], by_foot, atol=1e-5)
        by_size = difference(
            lambda s, e=unit: predict_boxes(seen_from, foot, heading, HALF * np.exp(s * e))
        )
        np.testing.assert_allclose(seen.by_size[..., axis], by_size, atol=1e-5)

        def shifted(s, e=unit):
            moved = seen_from.position + seen_from.rotation @ (s * e)
            return predict_boxes(Views(CAMERA, seen_from.rotation, moved), foot, heading, HALF)

        def turned(s, e=unit):
            turns = seen_from.rotation @ Rotation.from_rotvec(s * e).as_matrix()
            return predict_boxes(Views(CAMERA, turns, seen_from.position), foot, heading, HALF)

        np.testing.assert_allclose(seen.by_camera[..., axis], difference(shifted), atol=1e-5)
        np.testing.assert_allclose(seen.by_camera[..., 3 + axis], difference(turned), atol=1e-5)
    by_heading = difference(lambda s: predict_boxes(seen_from, foot, heading + s, HALF))
    np.testing.assert_allclose(seen.by_place[..., 3], by_heading, atol=1e-5)


@pytest.mark.parametrize(("ahead", "in_front", "whole"), [(-5.0, 0, 0), (1.0, 1, 0), (5.0, 1, 1)])
def test_what_is_beside_or_behind_the_camera_is_said(ahead, in_front, whole):
    """The cuboid reaches from 2 m behind its middle to 2 m before it."""
    seen = predict_boxes(views(), np.array([[ahead, 0.0, -1.0]]), np.zeros(1), HALF)
    assert (seen.in_front[0], seen.is_whole[0]) == (in_front, whole)
    assert np.isnan(seen.box).all() != in_front
