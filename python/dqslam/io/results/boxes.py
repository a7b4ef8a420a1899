"""Boxes of an estimate as CSV, with a row for each box, used or not.

``timestamp``
    Seconds; it is the time of a pose in ``trajectory.txt``.
``x1 y1 x2 y2``
    Corners in undistorted pixels, with whole numbers at pixel centers.
``truncated``
    Names of the edges at the border of the image, which cuts the object there.
``score class_id class_name``
    The output of the detector.
``object_id``
    The object that the box was assigned to, -1 for none.
``inlier``
    1 if the box was used and fits the estimate, else 0.
``held_out``
    1 if the box was held out from the estimator for a test, else 0.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.estimate import Estimate
from dqslam.io.csv_table import CsvTable, read_csv
from dqslam.io.files import FileError, write_text
from dqslam.recording import Detections

EDGES = ("x1", "y1", "x2", "y2")
COLUMNS = (
    "timestamp",
    *EDGES,
    "truncated",
    "score",
    "class_id",
    "class_name",
    "object_id",
    "inlier",
    "held_out",
)


@dataclass(frozen=True, eq=False)
class BoxTable:
    """The rows of ``boxes.csv``."""

    pose: Ints
    """Row of the pose from which it was observed, shape (m,)."""
    box: Floats
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (m, 4)."""
    truncated: Bools
    """Whether each edge is at the border of the image, shape (m, 4)."""
    score: Floats
    """Shape (m,)."""
    class_id: Ints
    """Shape (m,)."""
    class_name: tuple[str, ...]
    """One per box."""
    object_id: Ints
    """Object that the box was assigned to, -1 for none; shape (m,)."""
    inlier: Bools
    """Whether the box was used and fits, shape (m,)."""
    held_out: Bools
    """Whether the box was held out from the estimator for a test, shape (m,)."""

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.box)


def write_boxes(
    path: str | Path, estimate: Estimate, detections: Detections, held_out: Bools | None
) -> None:
    """Write the boxes of an estimate.

    `estimate.inliers` has an entry for each box that has an object and was not held out.
    """
    held_out = np.zeros(len(detections), dtype=np.bool_) if held_out is None else held_out
    used = (detections.object_id >= 0) & ~held_out
    if len(estimate.inliers) != used.sum():
        raise ValueError(
            f"detections: {used.sum()} boxes have an object and are not held out, but the "
            f"estimate is of {len(estimate.inliers)}"
        )
    inlier = np.zeros(len(detections), dtype=np.bool_)
    inlier[used] = estimate.inliers
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in range(len(detections)):
        class_id = int(detections.class_id[row])
        cut = (name for name, cut in zip(EDGES, detections.truncated[row], strict=True) if cut)
        writer.writerow(
            [
                repr(float(estimate.timestamps[detections.pose[row]])),
                *(f"{edge:.4f}" for edge in detections.box[row]),
                " ".join(cut),
                f"{detections.score[row]:g}",
                class_id,
                " ".join(detections.class_names[class_id].splitlines()),  # rows are lines
                int(detections.object_id[row]),
                int(inlier[row]),
                int(held_out[row]),
            ]
        )
    write_text(path, text.getvalue())


def read_boxes(path: str | Path, timestamps: Floats) -> BoxTable:
    """Read the boxes that were observed from poses at these times, shape (n,)."""
    table = read_csv(path, required=COLUMNS, allow_empty=True)
    time = table.numbers("timestamp")
    pose = np.searchsorted(timestamps, time).clip(max=len(timestamps) - 1)
    table.reject(timestamps[pose] != time, "timestamp {} is of no pose", "timestamp")
    box = np.column_stack([table.numbers(name) for name in EDGES])
    empty = np.any(box[:, 2:] <= box[:, :2], axis=1)
    table.reject(empty, "empty box: x1 < x2, y1 < y2")
    return BoxTable(
        pose=pose,
        box=box,
        truncated=_edges(table),
        score=table.numbers("score"),
        class_id=table.integers("class_id"),
        class_name=table.cells("class_name"),
        object_id=table.integers("object_id"),
        inlier=table.flags("inlier"),
        held_out=table.flags("held_out"),
    )


def _edges(table: CsvTable) -> Bools:
    flags = np.zeros((len(table), len(EDGES)), dtype=np.bool_)
    for row, cell in enumerate(table.cells("truncated")):
        for name in cell.split():
            if name not in EDGES:
                message = f"truncated names {name!r}, not one of {' '.join(EDGES)}"
                raise FileError(table.path, message, table.lines[row])
            flags[row, EDGES.index(name)] = True
    return flags
