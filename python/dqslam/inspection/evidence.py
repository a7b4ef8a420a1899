"""What the checks compare: how well rays meet under one reading of the files and under another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.rays import Views, residuals
from dqslam.inspection.tracks import FEWEST_VIEWS, Ids, find_tracks
from dqslam.io import DetectionTable, Trajectory, nearest_pose

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """A mistake that a check found, by its name, and what it saw."""

    check: str
    message: str


class CannotTellError(Exception):
    """A check has too little to go by."""


@dataclass(frozen=True)
class Evidence:
    """A recording as read: boxes unchecked and uncut, and which of them are of one object."""

    camera: _core.Camera
    trajectory: Trajectory
    table: DetectionTable
    pose: NDArray[np.int64]  #: (m,) row of the pose nearest in time to each box
    timely: NDArray[np.bool_]  #: (m,) whether that is near enough
    tolerance: float  #: what is near enough [s]
    ids: Ids | None

    @classmethod
    def of(
        cls,
        camera: _core.Camera,
        trajectory: Trajectory,
        table: DetectionTable,
        ids: Ids | None,
        max_time_difference: float | None,
    ) -> Evidence:
        """Join boxes to poses, within half the median interval of poses unless told otherwise."""
        times = trajectory.timestamps
        if len(times) < 2:
            raise ValueError("one pose only: nothing moves")
        pose, late = nearest_pose(times, table.timestamp)
        tolerance = 0.5 * float(np.median(np.diff(times)))
        if max_time_difference is not None:
            tolerance = max_time_difference
        return cls(camera, trajectory, table, pose, late <= tolerance, tolerance, ids)

    def tracks(self, boxes: Floats | None = None) -> list[NDArray[np.int64]]:
        """Return rows of tracks that have poses, of the boxes as given or as read otherwise."""
        table = self.table if boxes is None else replace(self.table, box=boxes)
        timely = (group[self.timely[group]] for group in find_tracks(table, self.ids))
        tracks = [group for group in timely if len(group) >= FEWEST_VIEWS]
        if not tracks:
            raise CannotTellError("no object is seen often enough from known poses")
        return tracks

    def views(self, tracks: list[NDArray[np.int64]], boxes: Floats | None = None) -> Views:
        """Return poses and middles of boxes of each track."""
        boxes = self.table.box if boxes is None else boxes
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        longest = max(map(len, tracks))
        rows = np.array([np.pad(group, (0, longest - len(group)), "edge") for group in tracks])
        there = np.array([np.arange(longest) < len(group) for group in tracks])
        poses = self.trajectory.world_from_camera
        return Views(poses[self.pose[rows]], middle[rows], there)


def median_residual(camera: _core.Camera, views: Views) -> float:
    """Return the median of how far middles are from the point of their track [px]."""
    off = residuals(camera, views)
    if np.isnan(off).all():
        raise CannotTellError("no object is seen from directions that differ enough")
    return float(np.nanmedian(off))
