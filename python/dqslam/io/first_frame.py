"""Whether a file of boxes counts frames from 0 or from another number, by the poses beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam._checks import Floats
from dqslam.io.detections.table import DetectionTable
from dqslam.io.frames import FrameTimes
from dqslam.io.notes import Notes

ALL = 0.9  #: share of the frames with boxes from which a missing first frame is strange
OPTION = "--first-frame N gives the number of the first frame"


def with_first_frame(
    table: DetectionTable, pose_times: Floats, frames: FrameTimes | None, notes: Notes
) -> DetectionTable:
    """Return boxes whose first frame is that of the first pose, if their numbers show it.

    Nothing is changed where the file, its format or the user says how frames are counted, or where
    frames have a table of times. Otherwise frames that are exactly as many as those of the poses,
    but leave them at the end, are shifted to them. Less clear cases are noted.
    """
    if not table.assumed_first or frames is None or frames.table is not None or not len(table):
        return table
    first, last = (round(float(time) * frames.rate) for time in (pose_times[0], pose_times[-1]))
    low, high = int(table.frame.min()), int(table.frame.max())
    shift = high - last
    if shift > 0 and low - shift == first:
        notes.doubt(
            table.path,
            f"boxes are of frames {low} to {high}, poses of {first} to {last}, as many: frame "
            f"{low} is taken for the first one; {OPTION}",
        )
        time = table.timestamp - shift / frames.rate
        return replace(table, frame=table.frame - shift, timestamp=time)
    if 0 < shift <= low - first:
        notes.doubt(
            table.path,
            f"boxes are of frames {low} to {high}, counted from 0, poses of {first} to {last}: do "
            f"frames begin with another number? {OPTION}",
        )
    elif low == first + 1 and len(np.unique(table.frame)) >= ALL * (high - low + 1) > 1:
        notes.doubt(
            table.path,
            f"the first frame with boxes is {low}, and frames count from {first}: does the file "
            f"count from {low}? {OPTION}",
        )
    return table
