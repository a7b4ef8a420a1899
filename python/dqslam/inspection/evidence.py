"""The evidence for the checks: how well rays meet under different interpretations of the files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.comparison import FEWEST_WINDOWS, WindowViews
from dqslam.inspection.rays import Views, residuals
from dqslam.inspection.tracks import FEWEST_VIEWS, Ids, find_tracks, thinned
from dqslam.inspection.windows import find_windows
from dqslam.io import DetectionTable, Trajectory, nearest_pose
from dqslam.recording.interpolation import interpolate_poses

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Finding:
    """A mistake that a check found: the name of the check, and a description."""

    check: str
    message: str

    def __str__(self) -> str:
        """Say it in a sentence."""
        return f"{self.check}: {self.message}"


class NotEnoughDataError(Exception):
    """A check has too little data for a conclusion."""


@dataclass(frozen=True)
class Evidence:
    """A recording as read, with unchecked and uncut boxes, and the tracks of its objects."""

    camera: _core.Camera
    trajectory: Trajectory
    table: DetectionTable
    pose: NDArray[np.int64]  #: (m,) row of the pose nearest in time to each box
    timely: NDArray[np.bool_]  #: (m,) whether that pose is within the tolerance
    tolerance: float  #: the largest time from a box to its pose [s]
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
        """Join boxes to poses, by default within half the median interval of poses."""
        times = trajectory.timestamps
        if len(times) < 2:
            raise ValueError("one pose only: nothing moves")
        pose, late = nearest_pose(times, table.timestamp)
        tolerance = 0.5 * float(np.median(np.diff(times)))
        if max_time_difference is not None:
            tolerance = max_time_difference
        return cls(camera, trajectory, table, pose, late <= tolerance, tolerance, ids)

    @cached_property
    def _tracks(self) -> list[NDArray[np.int64]]:
        return self._find_tracks(self.table)

    @cached_property
    def _windows(self) -> WindowViews:
        return self._find_windows(self.tracks(), self.table.box)

    def tracks(self, boxes: Floats | None = None) -> list[NDArray[np.int64]]:
        """Return the rows of tracks with poses, for the given boxes or other corners of them."""
        return self._tracks if boxes is None else self._find_tracks(replace(self.table, box=boxes))

    def _find_tracks(self, table: DetectionTable) -> list[NDArray[np.int64]]:
        timely = (group[self.timely[group]] for group in find_tracks(table, self.ids))
        tracks = [group for group in timely if len(group) >= FEWEST_VIEWS]
        if not tracks:
            raise NotEnoughDataError("no object is seen often enough from known poses")
        return tracks

    def views(self, tracks: list[NDArray[np.int64]], boxes: Floats | None = None) -> Views:
        """Return the poses and the middles of the boxes of each track."""
        boxes = self.table.box if boxes is None else boxes
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        tracks = [thinned(group) for group in tracks]
        longest = max(map(len, tracks))
        rows = np.array([np.pad(group, (0, longest - len(group)), "edge") for group in tracks])
        there = np.array([np.arange(longest) < len(group) for group in tracks])
        poses = self.trajectory.world_from_camera
        return Views(poses[self.pose[rows]], middle[rows], there)

    def windows(
        self, tracks: list[NDArray[np.int64]] | None = None, boxes: Floats | None = None
    ) -> WindowViews:
        """Return the views of windows, with the poses at the times of their boxes.

        Boxes may be read otherwise, and tracks be those of other boxes.
        """
        if tracks is None and boxes is None:
            return self._windows
        boxes = self.table.box if boxes is None else boxes
        return self._find_windows(self.tracks() if tracks is None else tracks, boxes)

    def _find_windows(self, tracks: list[NDArray[np.int64]], boxes: Floats) -> WindowViews:
        middle = (boxes[:, :2] + boxes[:, 2:]) / 2
        windows = find_windows(tracks, middle, self.table.timestamp)
        if len(windows) < FEWEST_WINDOWS:
            raise NotEnoughDataError("no object moves through the image and is seen often enough")
        poses = interpolate_poses(*self.trajectory, self.table.timestamp[windows.rows])
        return WindowViews(self.camera, windows, poses, middle[windows.rows])


def median_residual(camera: _core.Camera, views: Views) -> float:
    """Return the median distance of middles from the projected point of their track [px]."""
    off = residuals(camera, views)
    if np.isnan(off).all():
        raise NotEnoughDataError("no object is seen from directions that differ enough")
    return float(np.nanmedian(off))
