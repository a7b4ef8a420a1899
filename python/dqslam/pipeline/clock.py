"""Boxes at the poses of other times: an offset of the clocks that is larger than an image or so.

Estimating an offset with all else (`estimate_calibrated`) moves boxes by the motion next to their
pose, and finds the least cost next to where it begins. It begins where a search over many offsets
ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dqslam import _core
from dqslam.calibration import (
    CalibrationFinding,
    ClockError,
    find_clock_error,
    one_sided,
    parameter_rows,
)
from dqslam.calibration.parameters import calibration_parameters, parameter_units
from dqslam.graph import Graph
from dqslam.io import nearest_pose
from dqslam.io.recording import NEAR_SHARE
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import Progress, RunOptions
from dqslam.pipeline.problem import kept_options, kept_problem, state_of
from dqslam.recording import Recording
from dqslam.recording.interpolation import split_steps

_NAME = "time_offset"
# Boxes find their objects anew with each offset, and the next offset may be a better one.
MOST_ROUNDS = 4


@dataclass(frozen=True)
class CoarseOffset:
    """Where the estimate of an offset of time begins: how much later images are than told."""

    seconds: float = 0.0
    sigma: float = 0.0  #: of it, if it is final; else what is added to that of the estimate
    is_final: bool = False
    remarks: tuple[str, ...] = ()

    def added_to(self, output: EstimatorOutput) -> EstimatorOutput:
        """Return an output whose estimated offset is that from the times as given."""
        found = tuple(self._whole(one) if one.name == _NAME else one for one in output.estimated)
        if self.is_final:
            unit = parameter_units()[calibration_parameters().index(_NAME)]
            found = (*found, CalibrationFinding(_NAME, self.seconds, self.sigma, unit))
        return replace(output, estimated=found, remarks=(*output.remarks, *self.remarks))

    def _whole(self, rest: CalibrationFinding) -> CalibrationFinding:
        """Return the offset from the times as given, from what was left to estimate."""
        sigma = float(np.hypot(rest.sigma, self.sigma))
        return replace(rest, value=rest.value + self.seconds, sigma=sigma)


def with_clock(
    recording: Recording,
    options: RunOptions,
    estimator: Callable[[Recording, RunOptions, Progress], EstimatorOutput],
    progress: Progress,
) -> tuple[Recording, RunOptions, CoarseOffset]:
    """Return a recording whose boxes are at the times that fit best, and what is left to estimate.

    Nothing changes unless the offset of time is to be estimated. Boxes move by whole images first.
    What is left is estimated with all else, or by the same search where that is more certain.
    """
    names = calibration_parameters()
    asked = [names[row] for row in parameter_rows(options.estimate)]
    images = np.unique(recording.timestamps[recording.detections.pose])
    if _NAME not in asked or len(images) < 2:
        return recording, options, CoarseOffset()
    interval = float(np.median(np.diff(images)))
    total = 0.0
    remarks: dict[str, None] = {}
    for number in range(1, MOST_ROUNDS + 1):
        bare = replace(recording, positions=None, measurements=(), absolute=None, closures=None)
        output = estimator(bare, options, progress)
        graph = kept_problem(output, bare, options.mode)
        if graph is None:
            return recording, options, CoarseOffset(total, remarks=tuple(remarks))
        state = state_of(output, graph)
        found = find_clock_error(graph, state)
        if found is None or not found.is_sure or abs(found.seconds) < interval / 2:
            is_final, sigma = _choose(graph, state, options, found)
            break
        if found.rate:
            remarks[str(found)] = None
        if number == MOST_ROUNDS:
            remarks[f"the offset of time does not stand still in {MOST_ROUNDS} rounds"] = None
            is_final, sigma = True, abs(found.seconds)
            break
        step = interval * round(found.seconds / interval)
        recording, total = with_delay(recording, step), total + step
    if is_final and found is not None:
        recording, total = with_delay(recording, found.seconds), total + found.seconds
        options = replace(options, estimate=tuple(name for name in asked if name != _NAME))
    return recording, options, CoarseOffset(total, sigma, is_final, tuple(remarks))


def _choose(
    graph: Graph, state: _core.State, options: RunOptions, found: ClockError | None
) -> tuple[bool, float]:
    """Return whether what a search has found is final, and its sigma.

    If not, that is what the motion next to the poses adds to the sigma of an estimate [s].
    """
    try:
        after, before, sigma = one_sided(graph, state, kept_options(options))
    except (RuntimeError, ValueError):
        return (False, 0.0) if found is None else (True, found.sigma)
    apart = 0.5 * abs(after - before)
    if found is None or np.hypot(sigma, apart) <= found.sigma:
        return False, apart
    return True, found.sigma


def with_delay(recording: Recording, seconds: float) -> Recording:
    """Return a recording whose boxes are taken later than before.

    Boxes between two poses get a pose of their own; those before the first or after the last pose
    are left out. Other measurements stay where they are.
    """
    times, boxes = recording.timestamps, recording.detections
    at = times[boxes.pose] + seconds
    near, late = nearest_pose(times, at)
    before = np.clip(np.searchsorted(times, at) - 1, 0, len(times) - 2)
    own = late <= NEAR_SHARE * np.diff(times)[before]
    at = np.where(own, times[near], at)
    inside = (at >= times[0]) & (at <= times[-1])
    odometry, together = split_steps(recording.odometry, times, np.unique(at[inside]))
    row = np.searchsorted(together, times)
    changes: dict[str, Any] = {}
    for name, columns in (
        ("positions", ("pose",)),
        ("absolute", ("pose",)),
        ("closures", ("from_pose", "to_pose")),
    ):
        measured = getattr(recording, name)
        if measured is not None:
            moved = {column: row[getattr(measured, column)] for column in columns}
            changes[name] = replace(measured, **moved)
    measurements = tuple(replace(one, pose=row[one.pose]) for one in recording.measurements)
    kept = boxes.select(inside)
    moved_boxes = replace(kept, pose=np.searchsorted(together, at[inside]))
    return replace(
        recording,
        timestamps=together,
        odometry=odometry,
        detections=moved_boxes,
        measurements=measurements,
        **changes,
    )
