"""Gaps in a recording: no poses, no boxes, and one step of odometry across."""

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from dqslam import _core
from dqslam._checks import Bools, Ints
from dqslam._core import PoseModel
from dqslam.recording import Odometry, Recording, Truth
from dqslam.simulation.scenario import GapSettings


def leave_gaps(
    recording: Recording, truth: Truth, gaps: GapSettings, random: Generator
) -> tuple[Recording, Truth]:
    """Remove what was recorded in the gaps, and lead across each by one uncertain step.

    Raises
    ------
    ValueError
        If a gap is not inside the recording, gaps overlap, or none of the boxes is left.
    """
    first = _first_poses(recording, gaps)
    last = _last_poses(recording, gaps, first)
    kept = np.ones(len(truth.poses), dtype=np.bool_)
    for before, after in zip(first.tolist(), last.tolist(), strict=True):
        kept[before + 1 : after] = False
    row = np.cumsum(kept) - 1
    seen = kept[recording.detections.pose]
    detections = recording.detections.select(seen)
    if not len(detections):
        raise ValueError("odometry.gaps: no box is left")
    positions = recording.positions
    if positions is not None:
        has_box = np.isin(positions.object_id, detections.object_id)
        positions = positions.select(kept[positions.pose] & has_box)
        positions = replace(positions, pose=row[positions.pose])
    shown = truth.box_object_id
    return (
        replace(
            recording,
            timestamps=recording.timestamps[kept],
            odometry=_across(recording.odometry, truth, kept, (first, last), gaps, random),
            detections=replace(detections, pose=row[detections.pose]),
            positions=positions,
        ),
        replace(
            truth, poses=truth.poses[kept], box_object_id=None if shown is None else shown[seen]
        ),
    )


def _first_poses(recording: Recording, gaps: GapSettings) -> Ints:
    """Return the last pose before each gap."""
    times = recording.timestamps - recording.timestamps[0]
    starts = np.array(gaps.starts_s)
    if (np.diff(starts) <= gaps.duration_s).any():
        raise ValueError("odometry.gaps.starts_s: gaps overlap or do not ascend")
    first = np.searchsorted(times, starts, side="right") - 1
    if (first >= len(times) - 1).any():
        raise ValueError("odometry.gaps.starts_s: a gap starts at the end of the recording")
    return np.asarray(first)


def _last_poses(recording: Recording, gaps: GapSettings, first: Ints) -> Ints:
    """Return the first pose after each gap."""
    times = recording.timestamps
    # Times are sums of periods: a pose at the very end of a gap is not lost by rounding.
    last = np.searchsorted(times, times[first] + gaps.duration_s * (1.0 - 1e-9))
    last = np.maximum(last, first + 1)
    if (last >= len(times)).any():
        raise ValueError("odometry.gaps.duration_s: a gap outlasts the recording")
    return np.asarray(last)


def _across(
    odometry: Odometry,
    truth: Truth,
    kept: Bools,
    ends: tuple[Ints, Ints],
    gaps: GapSettings,
    random: Generator,
) -> Odometry:
    """Return the odometry of the poses that are kept."""
    model, (first, last) = odometry.pose_model, ends
    sizes = (2, 1) if model == PoseModel.SE2 else (3, 3)
    sigma = np.repeat([gaps.translation_sigma_m, gaps.rotation_sigma_rad], sizes)
    error = random.normal(0.0, sigma, size=(len(first), len(sigma)))
    true = _core.between(model, truth.poses[first], truth.poses[last])
    relative, covariance = odometry.relative.copy(), odometry.covariance.copy()
    # The step that leads to a kept pose is the one before it.
    relative[last - 1] = _core.plus(model, true, error)
    covariance[last - 1] = np.diag(sigma**2)
    return replace(odometry, relative=relative[kept[1:]], covariance=covariance[kept[1:]])
