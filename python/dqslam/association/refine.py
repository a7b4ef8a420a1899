"""Association with the whole path known: estimate, assign all boxes again, judge, and repeat."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from dqslam import _core
from dqslam._checks import Ints
from dqslam._ids import ObjectRow
from dqslam.association.consistency import (
    find_misfits,
    find_movers,
    find_scattered,
    join_duplicates,
)
from dqslam.association.follow import Follower, choose
from dqslam.association.gating import PredictedBoxes, predict_certain_boxes
from dqslam.association.images import group_by_pose
from dqslam.association.initiation import MIN_VIEWS
from dqslam.association.scene_map import SceneMap

# Rounds of estimating, assigning and judging: after the third hardly a box changes.
ROUNDS = 3
# Iterations of an estimate of the whole path; it stops where the cost does.
MAX_ITERATIONS = 50
# The level of the noise is settled when it changes by less, as a logarithm ...
NOISE_MAX_CHANGE = 0.05
# ... or was corrected so many times.
MAX_NOISE_CORRECTIONS = 6
# A box waits unless its choice is better than all others by this: -2 ln of the odds, 3 to 1. With
# the whole path known, waiting helps no more.
MIN_MARGIN_AFTERWARDS = 2.0


def refine(
    scene: SceneMap, follower: Follower, progress: Callable[[float], None] = lambda share: None
) -> None:
    """Make the map agree with itself; ``progress`` is called with the share that is done."""
    labels = scene.labels
    for done in range(ROUNDS):
        settle(scene)
        reassign(scene, follower.switch_cost)
        labels.give_up(np.flatnonzero(labels.box_counts < MIN_VIEWS))
        follower.initiate_objects(scene)
        if not follower.final:
            join_duplicates(scene)
        labels.dropped = find_misfits(scene)
        labels.dropped |= find_movers(scene)
        if follower.final:
            labels.dropped |= find_scattered(scene)
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
    labels = scene.labels
    refused = np.flatnonzero(labels.object_rows < 0)
    labels.assign(refused, labels.object_of_tracklet[labels.tracklets[refused]])
    labels.dropped = {}
    settle(scene)
    reassign(scene, np.inf)
    labels.dropped = _find_few(scene)
    labels.dropped |= find_misfits(scene)
    labels.dropped |= find_movers(scene)
    labels.dropped |= find_scattered(scene)
    settle(scene)


def _find_few(scene: SceneMap) -> dict[ObjectRow, str]:
    """Return objects that too few boxes are left of."""
    counts = scene.labels.box_counts
    return {
        ObjectRow(row): f"one place explains {count} of its boxes, {MIN_VIEWS} are needed"
        for row, count in enumerate(counts.tolist())
        if 0 < count < MIN_VIEWS
    }


def settle(scene: SceneMap) -> None:
    """Estimate, and correct the level of the odometry's noise, until that changes no more."""
    for _ in range(MAX_NOISE_CORRECTIONS):
        scene.estimate(max_iterations=MAX_ITERATIONS)
        if scene.estimate_noise() < NOISE_MAX_CHANGE:
            break


def reassign(scene: SceneMap, switch_cost: float) -> None:
    """Assign all boxes again, those that waited too, each image by itself."""
    labels = scene.labels
    alive = np.flatnonzero(labels.box_counts > 0)
    found = np.full(len(labels.tracklets), -1)
    images = group_by_pose(scene.recording.detections.pose)
    predictions = _predict(scene, [pose for pose, _ in images], alive)
    for (_, rows), predicted in zip(images, predictions, strict=True):
        found[rows] = _choose_sure(scene, rows, alive, predicted, switch_cost)
    labels.release_all()
    labels.assign(np.arange(len(found)), found)
    shown = np.flatnonzero(found >= 0)
    pairs, counts = np.unique(
        np.column_stack([labels.tracklets[shown], found[shown]]), axis=0, return_counts=True
    )
    pairs = pairs[np.argsort(counts, kind="stable")]  # the most frequent comes last, and stays
    labels.object_of_tracklet[pairs[:, 0]] = pairs[:, 1]
    scene.flag_hidden_edges()


def assign_afterwards(
    scene: SceneMap, pose: int, rows: Ints, object_rows: Ints, switch_cost: float
) -> Ints:
    """Return the objects that the boxes of an image show, -1 for none, shape (b,)."""
    predicted = next(_predict(scene, [pose], object_rows))
    return _choose_sure(scene, rows, object_rows, predicted, switch_cost)


def _predict(scene: SceneMap, poses: list[int], object_rows: Ints) -> Iterator[PredictedBoxes]:
    """Return where objects are expected in the images of some poses.

    The path and the objects have been fitted to these very boxes: they count as certain, also in
    which of them hides another, where that is minded.
    """
    recording = scene.recording
    return predict_certain_boxes(
        recording.camera,
        recording.odometry.pose_model,
        scene.poses[poses],
        scene.ellipsoids[object_rows],
        sees_hidden=scene.minds_occlusion,
    )


def _choose_sure(
    scene: SceneMap, rows: Ints, object_rows: Ints, predicted: PredictedBoxes, switch_cost: float
) -> Ints:
    """Return the objects that the boxes of an image show, -1 for none or in doubt, shape (b,)."""
    choice, margin = choose(scene, rows, object_rows, predicted, switch_cost)
    return np.where(margin >= MIN_MARGIN_AFTERWARDS, choice, -1)
