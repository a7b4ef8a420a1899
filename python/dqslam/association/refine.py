"""Association with the whole path known: estimate, assign all boxes again, judge, and repeat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association.consistency import (
    find_misfits,
    find_movers,
    find_scattered,
    join_duplicates,
)
from dqslam.association.follow import Follower, choose, predict
from dqslam.association.images import group_by_pose
from dqslam.association.initiation import FEWEST_VIEWS
from dqslam.association.scene_map import SceneMap

ROUNDS = 3
MAX_ITERATIONS = 50
# The noise is settled when its level changes by less, as a logarithm, or after so many times.
SETTLED = 0.05
MOST_CORRECTIONS = 6
# -2 ln of the odds, 3 to 1: with the whole path known, waiting helps no more.
AMBIGUOUS = 2.0


def refine(follower: Follower, progress: Callable[[float], None]) -> None:
    """Make the map agree with itself; ``progress`` is told the share that is done."""
    scene = follower.scene
    for done in range(ROUNDS):
        settle(scene)
        reassign(scene, follower.bonus)
        for number in np.flatnonzero(scene.box_counts < FEWEST_VIEWS).tolist():
            scene.give_up(number)
        follower.give_birth()
        if not follower.final:
            join_duplicates(scene)
        scene.left_out = find_misfits(scene)
        scene.left_out |= find_movers(scene)
        if follower.final:
            scene.left_out |= find_scattered(scene)
        progress((done + 1) / ROUNDS)
    settle(scene)
    if follower.final and scene.mode == _core.Mode.SLAM:
        try_refused(scene)


def try_refused(scene: SceneMap) -> None:
    """Believe all boxes of final ids in the map once, and judge by what comes of it.

    Along a drifting path a box that is right may be refused. The map then agrees with itself
    without it, the path bent where it is missing, and round after round refuses it again. Final ids
    say which object a box shows: all take part once, under a robust loss, those of objects that
    were left out as well.
    """
    refused = np.flatnonzero(scene.box_object < 0)
    own = [scene.object_of_tracklet.get(int(one), -1) for one in scene.tracklet[refused]]
    scene.claim(refused, np.array(own, dtype=np.int64))
    scene.left_out = {}
    settle(scene)
    reassign(scene, np.inf)
    scene.left_out = _find_few(scene)
    scene.left_out |= find_misfits(scene)
    scene.left_out |= find_movers(scene)
    scene.left_out |= find_scattered(scene)
    settle(scene)


def _find_few(scene: SceneMap) -> dict[int, str]:
    """Return objects that too few boxes are left of."""
    counts = scene.box_counts
    return {
        row: f"one place explains {counts[row]} of its boxes, {FEWEST_VIEWS} are needed"
        for row in np.flatnonzero((counts > 0) & (counts < FEWEST_VIEWS)).tolist()
    }


def settle(scene: SceneMap) -> None:
    """Estimate, and correct the level of the odometry's noise, until that changes no more."""
    for _ in range(MOST_CORRECTIONS):
        scene.estimate(max_iterations=MAX_ITERATIONS)
        if scene.estimate_noise() < SETTLED:
            break


def reassign(scene: SceneMap, bonus: float) -> None:
    """Assign all boxes again, those that waited too, each image by itself."""
    detections = scene.recording.detections
    alive = np.flatnonzero(scene.box_counts > 0)
    found = np.full(len(detections), -1)
    for pose, rows in group_by_pose(detections.pose):
        found[rows] = assign_afterwards(scene, pose, rows, alive, bonus)
    scene.release_all()
    scene.claim(np.arange(len(found)), found)
    claimed = np.flatnonzero(found >= 0)
    pairs, counts = np.unique(
        np.column_stack([scene.tracklet[claimed], found[claimed]]), axis=0, return_counts=True
    )
    for row in np.argsort(counts, kind="stable"):  # the most frequent comes last, and stays
        scene.object_of_tracklet[int(pairs[row, 0])] = int(pairs[row, 1])


def assign_afterwards(
    scene: SceneMap,
    pose: int,
    rows: NDArray[np.int64],
    objects: NDArray[np.int64],
    bonus: float,
) -> NDArray[np.int64]:
    """Return the objects that the boxes of an image show, -1 for none, shape (b,).

    The path and the objects have been fitted to these very boxes: they count as certain.
    """
    k = scene.recording.odometry.covariance.shape[1]
    certain = np.zeros((k + 9 * len(objects),) * 2)
    predicted = predict(scene, pose, objects, certain)
    choice, margin = choose(scene, rows, objects, predicted, bonus)
    return np.where(margin >= AMBIGUOUS, choice, -1)
