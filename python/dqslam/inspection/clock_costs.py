"""How much boxes miss at other times, for each part of the recording: two ways to compare.

In windows, a point at rest explains the views of an object along the path, and steps between views
that miss less are compared. That sees most where boxes are noisier than the odometry. Between
successive images, all boxes share the error of one step of the odometry. That sees most where the
odometry is noisier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam.inspection.comparison import WindowViews
from dqslam.inspection.evidence import Evidence, Floats, NotEnoughDataError
from dqslam.inspection.rays import at_depth_one
from dqslam.inspection.steps import find_steps, fit_steps, without_outliers
from dqslam.inspection.windows import FEWEST_STEPS, Windows, find_windows
from dqslam.recording.interpolation import interpolate_poses

FEWEST_PARTS, PARTS = 8, 24
# The least steps of the camera that are compared.
FEWEST_COMPARED = 60
# Errors of turns are taken for small [rad]: their squares are left out.
LARGEST_TURN = 0.05
# Parts of the time share the distances of objects, which are fitted at each offset anew. Over 30
# simulated recordings of five kinds, the errors were 1.37 times what independent parts would have.
WIDER = 1.4


@dataclass(frozen=True)
class TimeCosts:
    """Costs at some offsets, in parts of the time."""

    costs: Floats  #: (parts, k)
    when: Floats  #: (parts,) the middles of the parts [s]
    wider: float = 1.0  #: errors of the best offset, as a multiple of what the parts say


def window_costs(evidence: Evidence, offsets: Floats, most: int) -> TimeCosts:
    """Return the robust sums of misses in windows, at most so many of a length, at offsets (k,) s.

    Raises
    ------
    NotEnoughDataError
        If too few boxes move from view to view.
    """
    return _costs(evidence, _views(evidence, most), offsets)


def step_costs(evidence: Evidence, offsets: Floats) -> TimeCosts:
    """Return -2 log likelihood of the steps between images at offsets (k,) s.

    The levels of noise are those of the best offset. Each offset has the same steps of boxes.

    Raises
    ------
    NotEnoughDataError
        If boxes are seen in too few steps, or turns of the odometry are too noisy.
    """
    table, path = evidence.table, evidence.trajectory
    time, image = np.unique(table.timestamp, return_inverse=True)
    middle = (table.box[:, :2] + table.box[:, 2:]) / 2
    steps = find_steps(evidence.tracks(), image, at_depth_one(evidence.camera, middle))
    time = time[: steps.images]
    inside = (time[:-1] + offsets[0] >= path.timestamps[0]) & (
        time[1:] + offsets[-1] <= path.timestamps[-1]
    )
    if np.sum(steps.seen & inside) < FEWEST_COMPARED:
        raise NotEnoughDataError("too few boxes move from image to image")
    motions = [_motion(evidence, time + offset) for offset in offsets]
    given = len(offsets) // 2
    steps = without_outliers(steps, *motions[given])
    counted = steps.seen & inside
    fit = fit_steps(steps, *motions[given])
    costs = np.array([fit_steps(steps, *motion, fit).cost for motion in motions])[:, counted]
    best = int(np.argmin(costs.sum(axis=1)))
    if fit.levels[0] > LARGEST_TURN:
        raise NotEnoughDataError("the turns of the odometry are too noisy")
    if best != given:
        fit = fit_steps(steps, *motions[best])
        costs = np.array([fit_steps(steps, *motion, fit).cost for motion in motions])[:, counted]
    parts = np.array_split(np.arange(costs.shape[1]), PARTS)
    begin = time[:-1][counted]
    return TimeCosts(
        np.array([costs[:, part].sum(axis=1) for part in parts]),
        np.array([np.median(begin[part]) for part in parts]),
        wider=WIDER,
    )


def _motion(evidence: Evidence, time: Floats) -> tuple[Floats, Floats]:
    """Return the motion of the camera from each of these times to the next: see ``fit_steps``."""
    from scipy.spatial.transform import Rotation

    poses = interpolate_poses(*evidence.trajectory, time)
    turn = Rotation.from_quat(poses[:, 3:])
    back = turn[:-1].inv()
    return (back * turn[1:]).as_matrix(), back.apply(np.diff(poses[:, :3], axis=0))


def _views(evidence: Evidence, most: int) -> WindowViews:
    middle = (evidence.table.box[:, :2] + evidence.table.box[:, 2:]) / 2
    time = evidence.table.timestamp
    windows = find_windows(evidence.tracks(), middle, time, most=most)
    moving = windows.length < 2
    windows = Windows(
        windows.rows[moving], windows.there[moving], windows.length[moving], windows.part[moving]
    )
    if np.sum(windows.there[:, 1:]) < FEWEST_STEPS or len(np.unique(windows.part)) < FEWEST_PARTS:
        raise NotEnoughDataError("too few boxes move from view to view")
    poses = interpolate_poses(*evidence.trajectory, time[windows.rows])
    return WindowViews(evidence.camera, windows, poses, middle[windows.rows])


def _costs(evidence: Evidence, views: WindowViews, offsets: Floats) -> TimeCosts:
    """Return the robust sum of misses in each part of the time, at each offset."""
    windows = views.windows
    rows, there = windows.rows, windows.there
    time = evidence.table.timestamp[rows]
    inside = (time + offsets[0] >= evidence.trajectory.timestamps[0]) & (
        time + offsets[-1] <= evidence.trajectory.timestamps[-1]
    )
    known = there & inside
    pair = known[:, :-1] & known[:, 1:] & (rows[:, :-1] != rows[:, 1:])
    whole = np.all(inside | ~there, axis=1)  # at each offset, the same windows
    pair &= whole[:, None]
    frame = evidence.table.frame[rows]
    # Boxes of one step of the camera miss together: their mean counts.
    _, group = np.unique(
        np.stack([frame[:, :-1][pair], frame[:, 1:][pair]]), axis=1, return_inverse=True
    )
    group = group.reshape(-1)
    if group.size == 0 or group.max() + 1 < FEWEST_COMPARED:
        raise NotEnoughDataError("too few boxes move from view to view")
    number = np.bincount(group)
    part = np.zeros(len(number), dtype=np.int64)
    part[group] = np.broadcast_to(windows.part[:, None], pair.shape)[pair]
    misses = []
    for offset in offsets:
        poses = interpolate_poses(*evidence.trajectory, time + offset)
        moved = WindowViews(views.camera, windows, poses, views.middle)
        change = np.nan_to_num(np.diff(moved.fit().error, axis=1), nan=1.0)[pair]
        mean = [np.bincount(group, change[:, axis]) / number for axis in (0, 1)]
        misses.append(number * (mean[0] ** 2 + mean[1] ** 2))
    squares = np.array(misses).T
    scale = float(np.median(squares.min(axis=1))) * 2 + 1e-18
    costs = np.log1p(squares / scale)
    parts = np.unique(part)
    begin = np.zeros(len(number))
    begin[group] = time[:, :-1][pair]
    return TimeCosts(
        np.array([costs[part == one].sum(axis=0) for one in parts]),
        np.array([np.median(begin[part == one]) for one in parts]),
    )
