"""Objects that are one, that moved, that are no objects: found by what their boxes say together."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from dqslam.association.scene_map import SceneMap
from dqslam.assumptions.traffic import usual_size

# 99 % of chi-square with 3 degrees of freedom.
SAME_PLACE = 11.34
# Fitted centers of one box-shaped object, seen from two sides, differ by this part of its size.
SIDES = 0.3
# Share of the images of the rarer of two objects that may show both, by mistake.
SEEN_TOGETHER = 0.1
# Objects of a class, before it has a usual size.
ENOUGH = 5
# Logarithms of sizes within a class spread by at least this, and seldom by three times as much.
LEAST_SPREAD = 0.15
UNUSUAL = 3.0
# Of the logarithm of a size that is known beforehand: less than half, or twice, is another thing.
NOT_HALF = 0.5

# Of chi-square with 4 degrees of freedom.
MEDIAN_CHI2 = 3.36
# An object moved when without it the path explains its boxes worse than this, and with it pays
# this much: chi-squares a box, and as a multiple of what is usual.
BENT = 13.28
PAID = 2.0
PAID_MORE = 2.0
LEAST_BOXES = 8
# Share of the boxes of an id that one place explains, at least.
LEAST_FIT = 0.5
LEAVE_ONE_OUT_ITERATIONS = 8


def join_duplicates(scene: SceneMap) -> None:
    """Join objects of one class that may be in one place and are never seen together."""
    pairs = close_pairs(scene)
    if not pairs:
        return
    involved = np.unique(pairs)
    involved, covariance = scene.joint_covariance(len(scene.poses) - 1, involved)
    k = len(covariance) - 9 * len(involved)
    size = np.exp(scene.log_sizes())
    for kept, given_up in pairs:
        if not np.all(np.isin([kept, given_up], involved)):
            continue
        if scene.box_counts[kept] == 0 or scene.box_counts[given_up] == 0:
            continue
        if _are_seen_together(scene, kept, given_up):  # since one of them was joined with a third
            continue
        a, b = (k + 9 * np.searchsorted(involved, [kept, given_up])).tolist()
        spread = _of_difference(covariance, a, b)
        spread = spread + (SIDES * min(size[kept], size[given_up])) ** 2 * np.eye(3)
        apart = scene.ellipsoids[kept, :3] - scene.ellipsoids[given_up, :3]
        if apart @ np.linalg.solve(spread, apart) <= SAME_PLACE:
            scene.join_objects(kept, given_up)


def close_pairs(scene: SceneMap) -> list[tuple[int, int]]:
    """Return pairs of one class, a few sizes apart at most, that are not seen together."""
    alive = np.flatnonzero(scene.box_counts > 0)
    alive = alive[~np.isin(alive, list(scene.left_out))]
    if len(alive) < 2:
        return []
    size = np.exp(scene.log_sizes()[alive])
    center = scene.ellipsoids[alive, :3]
    called = scene.votes[alive].argmax(axis=1)
    distance = np.linalg.norm(center[:, None] - center, axis=2)
    near = (distance < 4 * (size[:, None] + size)) & (called[:, None] == called)
    pairs = [(int(alive[i]), int(alive[j])) for i, j in np.argwhere(np.triu(near, 1))]
    return [pair for pair in pairs if not _are_seen_together(scene, *pair)]


def _are_seen_together(scene: SceneMap, a: int, b: int) -> bool:
    """Tell whether images show both of two objects, more of them than by mistake."""
    pose = scene.recording.detections.pose
    first, second = (pose[scene.box_object == number] for number in (a, b))
    together = len(np.intersect1d(first, second))
    return together > SEEN_TOGETHER * min(len(first), len(second))


def _of_difference(covariance: NDArray[np.float64], a: int, b: int) -> NDArray[np.float64]:
    """Return the covariance of the difference of two points, at rows a and b of a joint one."""
    first, second = slice(a, a + 3), slice(b, b + 3)
    cross = covariance[first, second]
    return np.asarray(covariance[first, first] + covariance[second, second] - cross - cross.T)


def _usual(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the middle of the shortest half of some numbers, and a standard deviation from it.

    Nearly half of them may be wrong (Rousseeuw & Leroy 1987: the shorth).
    """
    values = np.sort(values)
    half = len(values) // 2
    first = int(np.argmin(values[half:] - values[: len(values) - half]))
    low, high = float(values[first]), float(values[first + half])
    return 0.5 * (low + high), 0.5 * (high - low) / 0.6745


def find_misfits(scene: SceneMap) -> dict[int, str]:
    """Return objects whose size is unusual for their class, and how.

    What moves along a straight line while the camera does looks like a thing at rest, at another
    distance, hence of another size: of cars that come towards us, about half. The usual size is
    learned from the objects of a class, of traffic from those that are not half as large as they
    should be: there, most may move.
    """
    alive = np.flatnonzero(scene.box_counts > 0)
    log_size = scene.log_sizes()
    called = scene.votes.argmax(axis=1)
    misfits = {}
    for one in np.unique(called[alive]):
        members = alive[called[alive] == one]
        name = scene.recording.detections.class_names[int(scene.classes[one])]
        likely = log_size[members]
        known = usual_size(name)
        if known is not None:
            likely = likely[np.abs(likely - known) < NOT_HALF]
        if len(likely) < ENOUGH:
            continue
        usual, spread = _usual(likely)
        for number in members.tolist():
            ratio = log_size[number] - usual
            if abs(ratio) > UNUSUAL * max(spread, LEAST_SPREAD):
                misfits[number] = (
                    f"its size is {np.exp(ratio):.2g} times the usual one of a {name}: "
                    "it moved while it was seen, or is something else"
                )
    return misfits


def find_scattered(scene: SceneMap) -> dict[int, str]:
    """Return objects that do not explain most boxes of their own tracklets."""
    owner = np.array([scene.object_of_tracklet.get(int(t), -1) for t in scene.tracklet])
    seen = scene.recording.detections.pose < len(scene.poses)
    scattered = {}
    shown, counts = np.unique(scene.box_object[scene.box_object >= 0], return_counts=True)
    for number, count in zip(shown.tolist(), counts.tolist(), strict=True):
        share = count / np.sum(seen & (owner == number))
        if share < LEAST_FIT:
            scattered[number] = (
                f"one place explains {share:.0%} of its boxes: it moved, or its id names several"
            )
    return scattered


def find_movers(scene: SceneMap, suspects: Collection[int] | None = None) -> dict[int, str]:
    """Return objects, all or some ``suspects``, that are at rest only if the path bends to them.

    Each in turn is left out of the estimate. If it moved, its boxes do not fit any place then, and
    the cost that it causes, to the path and to the other objects as well, is gone. An object at
    rest may look the same as long as one that moved bends the path: the worst comes first, and the
    others are tried again without it.
    """
    part, counts = np.unique(scene.box_object[scene.box_object >= 0], return_counts=True)
    takes_part = ~np.isin(part, list(scene.left_out))
    if takes_part.sum() < 2:  # nothing else tells the path
        return {}
    asked = np.ones(len(part), dtype=bool) if suspects is None else np.isin(part, list(suspects))
    alive = part[takes_part & asked & (counts >= LEAST_BOXES)].tolist()
    fits = _fits_without(scene, alive, movers={}) if alive else {}
    movers: dict[int, str] = {}
    for number in sorted(fits, key=lambda one: -fits[one]):
        fit = _fits_without(scene, [number], movers).get(number) if movers else fits[number]
        if fit is not None:
            movers[number] = (
                "without it, the path explains its boxes "
                f"{fit / MEDIAN_CHI2:.0f} times worse than chance: it moved"
            )
    return movers


def _fits_without(scene: SceneMap, objects: list[int], movers: dict[int, str]) -> dict[int, float]:
    """Return those of some objects that bend the path, and how their boxes fit if they may not.

    The median chi-square of an object's boxes at one place, movers taking no part.
    """
    fits = {}
    claimed = np.flatnonzero(scene.box_object >= 0)
    chi2 = scene.chi2(claimed, scene.ellipsoids[scene.box_object[claimed]], blur=0.0)
    least = max(PAID, PAID_MORE * float(np.median(chi2)))
    with_all = scene.cost(max_iterations=LEAVE_ONE_OUT_ITERATIONS, without=movers)
    for number in objects:
        rows = np.flatnonzero(scene.box_object == number)
        without = scene.cost(max_iterations=LEAVE_ONE_OUT_ITERATIONS, without=[*movers, number])
        paid = 2.0 * (with_all.cost - without.cost) / len(rows)
        if paid < least:
            continue
        with scene.at(without.poses):
            ellipsoids, _ = scene.fit_groups([rows])
            fit = scene.chi2(rows, np.tile(ellipsoids, (len(rows), 1)), blur=0.0)
        if np.median(fit) > BENT:
            fits[number] = float(np.median(fit))
    return fits
