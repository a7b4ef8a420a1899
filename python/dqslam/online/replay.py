"""A recording as steps in the order of time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from dqslam import _core
from dqslam.online.slam import OnlineSlam
from dqslam.online.step import Motion, Step, StepBoxes, StepMeasurements, StepPositions
from dqslam.recording import Measurements, Recording, RelativePositions


@dataclass(frozen=True, eq=False)
class Frame:
    """A step of a replay, its report, and its time."""

    step: Step
    report: _core.StepReport
    milliseconds: float
    """Wall-clock time of ``add``."""


def steps_of(recording: Recording) -> Iterator[Step]:
    """Yield the steps of a recording in the order of time."""
    odometry, detections = recording.odometry, recording.detections
    count = len(recording.timestamps)
    order = np.argsort(detections.pose, kind="stable")
    begin = np.searchsorted(detections.pose[order], np.arange(count + 1))
    names = [detections.class_names[number] for number in detections.class_id.tolist()]
    for pose in range(count):
        rows = order[begin[pose] : begin[pose + 1]]
        motion = None
        if pose:
            motion = Motion(odometry.relative[pose - 1], odometry.covariance[pose - 1])
        yield Step(
            timestamp=float(recording.timestamps[pose]),
            odometry=motion,
            boxes=StepBoxes(
                box=detections.box[rows],
                object_id=detections.object_id[rows],
                class_name=[names[row] for row in rows],
                truncated=detections.truncated[rows],
                embedding=detections.embedding[rows],
            ),
            positions=_positions_at(recording.positions, pose),
            measurements=_measurements_at(recording.measurements, pose),
        )


def _positions_at(positions: RelativePositions | None, pose: int) -> StepPositions | None:
    if positions is None or pose not in positions.pose:
        return None
    here = positions.select(positions.pose == pose)
    return StepPositions(here.object_id, here.object_in_robot, here.covariance)


def _measurements_at(measurements: Iterable[Measurements], pose: int) -> list[StepMeasurements]:
    here = [(one, one.pose == pose) for one in measurements]
    return [
        StepMeasurements(one.kind, one.object_id[rows], one.value[rows], one.covariance[rows])
        for one, rows in here
        if rows.any()
    ]


def replay(slam: OnlineSlam, recording: Recording) -> Iterator[Frame]:
    """Add the steps of a recording to a session, and yield the report and time of each."""
    for step in steps_of(recording):
        start = perf_counter()
        report = slam.add(
            step.odometry,
            step.boxes,
            timestamp=step.timestamp,
            positions=step.positions,
            measurements=step.measurements,
        )
        yield Frame(step, report, 1e3 * (perf_counter() - start))
