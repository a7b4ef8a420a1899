"""The problem of a graph with deviations of its calibration."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.calibration.parameters import calibration_parameters
from dqslam.subgraph import rebuilt


def recalibrate(
    core: _core.Graph,
    state: _core.State,
    timestamps: Floats,
    deviations: Floats,
    *,
    is_late: bool = True,
) -> _core.Graph:
    """Return a problem with deviations of its parameters, shape (p,).

    Boxes that are late move as a state predicts it. Between two poses, the robot moves as from one
    to the other: where its motion changes at a pose, so does what a delay does to the boxes.
    ``is_late`` tells which of these motions it is: after the time of a pose, or before it.
    """
    row = calibration_parameters().index("time_offset")
    delay = float(deviations[row])
    others = np.array(deviations, dtype=np.float64)
    others[row] = 0.0
    changed = _core.recalibrate(core, state, timestamps, others)
    if delay == 0.0:
        return changed
    table, model = changed.boxes, core.pose_model
    shown = state.landmarks[table.object]
    late = _delayed(model, state.poses, timestamps, delay, is_late)
    now, is_seen = _core.project_to_boxes(model, core.camera, state.poses[table.pose], shown)
    then, stays_seen = _core.project_to_boxes(model, core.camera, late[table.pose], shown)
    shift = np.where((is_seen & stays_seen)[:, None], then - now, 0.0)
    boxes = _core.BoxTable(
        pose=table.pose,
        object=table.object,
        box=table.box - shift,
        covariance=table.covariance,
        truncated=table.truncated,
    )
    return rebuilt(changed, boxes=boxes)


def _delayed(
    model: _core.PoseModel, poses: Floats, timestamps: Floats, delay: float, is_late: bool
) -> Floats:
    """Return where the robot is a delay after its poses, (n, d), by the motion after or before."""
    if len(poses) < 2:
        return poses
    step = np.clip(np.arange(len(poses)) - (not is_late), 0, len(poses) - 2)
    motion = _core.minus(model, poses[step + 1], poses[step])
    seconds = np.diff(timestamps)[step]
    return _core.plus(model, poses, motion * (delay / seconds)[:, None])
