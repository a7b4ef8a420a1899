"""The content of a recording in numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.evidence import Evidence, Floats
from dqslam.io import DetectionTable, Trajectory

# A gap is longer than this number of median intervals.
GAP = 5.0
# An edge within this number of pixels is at the border of the image.
BORDER_PX = 1.5
QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)


def summarize(evidence: Evidence) -> dict[str, Any]:
    """Return counts, rates, spans [s], lengths [m] and sizes [px], ready for JSON."""
    return {
        "camera": _camera(evidence.camera),
        "trajectory": _trajectory(evidence.trajectory),
        "detections": _detections(evidence.camera, evidence.table),
        "overlap": _overlap(evidence),
    }


def _camera(camera: _core.Camera) -> dict[str, Any]:
    return {
        "width": camera.width,
        "height": camera.height,
        "field_of_view_deg": [
            float(np.degrees(2 * np.arctan(size / (2 * focal))))
            for size, focal in ((camera.width, camera.fx), (camera.height, camera.fy))
        ],
        "distortion": camera.distortion if camera.has_distortion else None,
    }


def _trajectory(trajectory: Trajectory) -> dict[str, Any]:
    times, poses = trajectory
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    return {
        "poses": len(times),
        **_clock(times),
        "length_m": float(steps.sum()),
        "extent_m": np.ptp(poses[:, :3], axis=0),
        "largest_step_m": float(steps.max(initial=0)),
    }


def _detections(camera: _core.Camera, table: DetectionTable) -> dict[str, Any]:
    names = dict(zip(table.class_id.tolist(), table.class_name, strict=True))
    numbers, counts = np.unique(table.class_id, return_counts=True)
    classes = sorted(zip(counts.tolist(), numbers.tolist(), strict=True), reverse=True)
    size = table.box[:, 2:] - table.box[:, :2]
    tracks = None if table.track_id is None else table.track_id[table.track_id >= 0]
    frames, boxes = np.unique(table.frame, return_counts=True)
    return {
        "boxes": len(table),
        "frames": len(frames),
        "boxes_a_frame": _quantiles(boxes),
        **_clock(np.unique(table.timestamp)),
        "classes": {names[number] or str(number): count for count, number in classes},
        "score": _quantiles(table.score),
        "width_px": _quantiles(size[:, 0]),
        "height_px": _quantiles(size[:, 1]),
        "at_border": _at_border(camera, table.box),
        "objects": None if tracks is None else len(np.unique(tracks)),
        "boxes_without_object": None if tracks is None else len(table) - len(tracks),
    }


def _at_border(camera: _core.Camera, box: Floats) -> dict[str, int]:
    """Count the boxes that touch each border of the image or go beyond."""
    last = np.array([camera.width, camera.height]) - 0.5
    low, high = box[:, :2] <= -0.5 + BORDER_PX, box[:, 2:] >= last - BORDER_PX
    sides = zip(("left", "top", "right", "bottom"), np.hstack([low, high]).sum(axis=0), strict=True)
    return {name: int(count) for name, count in sides} | {
        "any": int(np.sum(np.any(low | high, axis=1)))
    }


def _overlap(evidence: Evidence) -> dict[str, Any]:
    poses, boxes = evidence.trajectory.timestamps, evidence.table.timestamp
    start, end = max(poses.min(), boxes.min()), min(poses.max(), boxes.max())
    return {
        "seconds": max(0.0, float(end - start)),
        "boxes_with_pose": int(evidence.timely.sum()),
        "boxes_without_pose": int(np.sum(~evidence.timely)),
        "tolerance_s": evidence.tolerance,
    }


def _clock(times: Floats) -> dict[str, Any]:
    """Describe increasing times (n,) s; gaps are longer than 5 median intervals."""
    steps = np.diff(times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > GAP * usual)
    return {
        "start_s": float(times[0]),
        "end_s": float(times[-1]),
        "rate_hz": 1 / usual if usual > 0 else None,
        "gaps": [{"after_s": float(times[i]), "seconds": float(steps[i])} for i in gaps],
    }


def _quantiles(values: NDArray[Any]) -> list[float]:
    """Return least, lower quartile, median, upper quartile and largest."""
    quantiles: list[float] = np.quantile(values, QUANTILES).tolist()
    return quantiles
