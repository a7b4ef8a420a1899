"""What is in a recording, and which of the usual mistakes are in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from dqslam import _core
from dqslam.inspection.checks import (
    check_box_corners,
    check_boxes,
    check_distortion,
    check_image_size,
    check_pose_direction,
)
from dqslam.inspection.evidence import CannotTellError, Evidence
from dqslam.inspection.evidence import Finding as Finding
from dqslam.inspection.summary import summarize
from dqslam.inspection.times import check_times
from dqslam.inspection.tracks import Ids as Ids
from dqslam.io import DetectionTable, Trajectory

Check = Callable[[Evidence], Finding | None]
# In an order in which no check takes the mistake of a former one for its own, each with those whose
# findings keep it from telling.
CHECKS: dict[str, tuple[Check, tuple[str, ...]]] = {
    "times": (check_times, ()),
    "box corners": (check_box_corners, ()),
    "image size": (check_image_size, ("box corners",)),
    "pose direction": (check_pose_direction, ("times", "box corners")),
    "distortion": (check_distortion, ("times", "box corners", "image size", "pose direction")),
    "boxes": (check_boxes, ("box corners", "image size")),
}


@dataclass(frozen=True)
class Inspection:
    """What is in a recording, and what was found in it."""

    summary: dict[str, Any]  #: ready for JSON
    findings: tuple[Finding, ...]
    unchecked: dict[str, str]  #: why a check could not tell, by its name


def inspect_recording(
    camera: _core.Camera,
    trajectory: Trajectory,
    table: DetectionTable,
    *,
    ids: Ids | None = None,
    max_time_difference: float | None = None,
) -> Inspection:
    """Look through a recording.

    Parameters
    ----------
    camera, trajectory
        As they were read.
    table
        Boxes, unchecked and uncut: ``read_detections(path, cut=False, check=False)``.
    ids
        The column that tells objects apart; without, boxes are joined by their overlap.
    max_time_difference
        Seconds from a box to its pose; by default half the median interval of poses.
    """
    evidence = Evidence.of(camera, trajectory, table, ids, max_time_difference)
    findings: dict[str, Finding] = {}
    unchecked: dict[str, str] = {}
    for name, (check, after) in CHECKS.items():
        found = [other for other in after if other in findings]
        if found:
            unchecked[name] = f"{found[0]} comes first"
            continue
        try:
            finding = check(evidence)
        except CannotTellError as error:
            unchecked[name] = str(error)
            continue
        if finding is not None:
            findings[name] = finding
    return Inspection(summarize(evidence), tuple(findings.values()), unchecked)
