"""Steps of boxes between images, beside those of the odometry, on scenes that are made by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam.inspection.steps import (
    FEWEST_VIEWS,
    MOST_VIEWS,
    find_steps,
    fit_steps,
    without_outliers,
)

IMAGES, OBJECTS = 60, 6


def scene(rng, *, rotation=0.0, box=0.0):
    """Return steps of boxes of resting points, the motion that odometry says, and distances.

    The camera goes along its x and shakes; the noise is that of its turns [rad], and of boxes.
    """
    points = np.column_stack(
        [rng.uniform(0, 6, OBJECTS), rng.uniform(-1, 1, OBJECTS), rng.uniform(4, 8, OBJECTS)]
    )
    time = np.arange(IMAGES)
    position = np.column_stack([0.1 * time, 0.05 * np.sin(time), 0.03 * np.cos(2 * time)])
    turn = Rotation.from_rotvec(
        0.05 * np.column_stack([np.sin(0.7 * time), np.cos(0.9 * time), np.sin(1.1 * time)])
    )
    rays = []
    for i in range(IMAGES):
        local = turn[i].inv().apply(points - position[i])
        rays.append(local[:, :2] / local[:, 2:])
    ray = np.array(rays) + box * rng.normal(size=(IMAGES, OBJECTS, 2))
    image = np.repeat(time, OBJECTS)
    tracks = [np.arange(one, IMAGES * OBJECTS, OBJECTS) for one in range(OBJECTS)]
    step = turn[:-1].inv() * turn[1:]
    step = step * Rotation.from_rotvec(rotation * rng.normal(size=(IMAGES - 1, 3)))
    shift = turn[:-1].inv().apply(np.diff(position, axis=0))
    return find_steps(tracks, image, ray.reshape(-1, 2)), step.as_matrix(), shift, points


def test_runs_are_of_successive_images():
    """A gap ends a run, a long run is cut with its last view shared, a short one is left out."""
    image = np.concatenate([np.arange(FEWEST_VIEWS), [10, 11], np.arange(20, 20 + MOST_VIEWS + 1)])
    ray = np.zeros((len(image), 2))
    steps = find_steps([np.arange(len(image))], image, ray)
    assert steps.there.sum(axis=1).tolist() == [2, 20, 20]
    assert steps.image[1, 20] == steps.image[2, 0] == 40
    assert steps.images == 20 + MOST_VIEWS + 1
    assert steps.seen.sum() == 2 + MOST_VIEWS
    empty = find_steps([], image, ray)
    assert len(empty.ray) == empty.seen.sum() == 0


def test_without_noise_distances_are_found_and_nothing_is_left():
    steps, turn, shift, points = scene(np.random.default_rng(0))
    fit = fit_steps(steps, turn, shift)
    assert np.abs(fit.left[steps.there]).max() < 5e-4
    unit = np.median(np.linalg.norm(shift, axis=1))
    first = steps.image[:, 0] == 0
    # The first camera is turned by 0.05 rad at most: depths are nearly z.
    np.testing.assert_allclose(np.sort(unit / fit.inverse[first]), np.sort(points[:, 2]), rtol=0.1)


def test_levels_of_noise_are_found():
    steps, turn, shift, _ = scene(np.random.default_rng(1), rotation=0.01, box=0.002)
    rotation, _, box = fit_steps(steps, turn, shift).levels
    assert rotation == pytest.approx(0.01, rel=0.25)
    # Each step has the noise of two boxes.
    assert box == pytest.approx(np.sqrt(2) * 0.002, rel=0.3)


def test_steps_of_another_time_cost_more():
    steps, turn, shift, _ = scene(np.random.default_rng(2), rotation=0.01, box=0.002)
    fit = fit_steps(steps, turn, shift)
    costs = [
        fit_steps(steps, np.roll(turn, late, axis=0), np.roll(shift, late, axis=0), fit).cost.sum()
        for late in (-2, -1, 0, 1, 2)
    ]
    assert np.argmin(costs) == 2
    assert min(costs[1], costs[3]) > costs[2] + 50


def test_a_track_that_changes_its_object_does_not_count_there():
    rng = np.random.default_rng(3)
    steps, turn, shift, _ = scene(rng, rotation=0.005, box=0.001)
    steps.ray[0, 10:] += 0.3
    kept = without_outliers(steps, turn, shift)
    assert not kept.used[0, 9]
    assert (steps.used & ~kept.used).sum() <= 8


def test_steps_with_one_box_have_finite_costs():
    """Six errors explain the two numbers of a box: the level of boxes has a least value."""
    _, turn, shift, _ = scene(np.random.default_rng(4), rotation=0.01)
    ray = np.column_stack([np.linspace(0.5, -0.5, IMAGES), np.zeros(IMAGES)])
    one = find_steps([np.arange(IMAGES)], np.arange(IMAGES), ray)
    fit = fit_steps(one, turn, shift)
    assert np.isfinite(fit.cost).all()
    assert np.isfinite(fit.levels).all()
