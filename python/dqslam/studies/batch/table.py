"""Every recording of a batch as one row: results.csv, and results.parquet with pyarrow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_type_hints

from dqslam.studies.batch.store import Record
from dqslam.studies.tables import write_table

Status = Literal["done", "doubtful", "failed"]
_STATUS: dict[int | None, Status] = {0: "done", 3: "doubtful"}


@dataclass(frozen=True)
class Row:
    """A recording of a batch, and the main numbers of its report. None is an empty cell."""

    name: str
    status: Status
    """Failed recordings have no numbers, even if results of an earlier run are there."""
    exit_code: int | None
    """Of ``dqslam run``; negative is the signal that ended it."""
    seconds: float | None = None
    """Wall clock. None if the batch was killed between the results and their record."""
    poses: int | None = None
    keyframes: int | None = None
    boxes: int | None = None
    """Boxes that show an object of the map."""
    objects: int | None = None
    dropped_objects: int | None = None
    warnings: int | None = None
    """Number of warnings in the report."""
    doubts: str | None = None
    """Why the result is doubtful."""
    box_noise_px: float | None = None
    box_noise_relative: float | None = None
    """Share of the side of a box."""
    odometry_translation_m: float | None = None
    """Root mean square of the estimated noise of a step; None if it was given."""
    odometry_rotation_rad: float | None = None
    iou_median: float | None = None
    """Of boxes and the outlines of the map, in the median; of held out boxes if there are any."""
    odometry_ate_m: float | None = None
    """Root mean square distance of the odometry from the truth after alignment, if truth is known.
    Truth is the trajectory of ``groundtruth``, or the odometry before noise was added."""
    ate_m: float | None = None
    """The same of the estimate."""
    error: str | None = None
    """Why the run failed."""


_TYPES: dict[str, type] = {
    name: next((kind for kind in get_args(hint) if kind in (int, float)), str)
    for name, hint in get_type_hints(Row).items()
}


def row_of(record: Record, report: dict[str, Any] | None) -> Row:
    """Make the row of a recording; without a report its run has failed."""
    if report is None:
        return Row(record.name, "failed", record.exit_code, record.seconds, error=record.error)
    doubts = report["doubts"]
    # A run whose end was not recorded has a report, which says what its exit code was.
    exit_code = record.exit_code if record.exit_code is not None else 3 if doubts else 0
    noise, errors = report["odometry_noise"], report["trajectory_error"] or {}
    return Row(
        name=record.name,
        status=_STATUS[exit_code],
        exit_code=exit_code,
        seconds=record.seconds,
        poses=report["poses"],
        keyframes=report["keyframes"],
        boxes=report["boxes"]["count"],
        objects=len(report["objects"]),
        dropped_objects=len(report["dropped_objects"]),
        warnings=len(report["warnings"]),
        doubts="; ".join(doubts) or None,
        box_noise_px=report["box_noise"]["pixels"],
        box_noise_relative=report["box_noise"]["relative"],
        odometry_translation_m=noise.get("translation_m"),
        odometry_rotation_rad=noise.get("rotation_rad"),
        iou_median=report["reprojection"]["iou_median"],
        odometry_ate_m=errors.get("before", {}).get("ate_rmse_m"),
        ate_m=errors.get("after", {}).get("ate_rmse_m"),
    )


def write_rows(folder: Path, rows: tuple[Row, ...]) -> list[Path]:
    """Write the table of a batch, and return the files."""
    columns = {name: [getattr(row, name) for row in rows] for name in _TYPES}
    return write_table(folder / "results", columns, _TYPES)
