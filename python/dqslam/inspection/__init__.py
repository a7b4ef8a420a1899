"""The content of a recording, and the usual mistakes that are in it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from dqslam import _core
from dqslam.inspection.box_checks import check_box_form
from dqslam.inspection.checks import check_boxes, check_distortion
from dqslam.inspection.clock import ClockOffset as ClockOffset
from dqslam.inspection.clock import check_clock, check_clock_shortly, estimate_clock_offset
from dqslam.inspection.evidence import Evidence, NotEnoughDataError
from dqslam.inspection.evidence import Finding as Finding
from dqslam.inspection.image_checks import check_image_size
from dqslam.inspection.odometry import check_doubles, check_units, note_jumps
from dqslam.inspection.odometry import find_jumps as find_jumps
from dqslam.inspection.pose_checks import Verdict as Verdict
from dqslam.inspection.pose_checks import check_explained, check_poses, judge
from dqslam.inspection.pose_checks import pixels as pixels
from dqslam.inspection.summary import summarize
from dqslam.inspection.times import check_times
from dqslam.inspection.tracks import Ids as Ids
from dqslam.io import DetectionTable, Trajectory

Check = Callable[[Evidence], Finding | None]
# The order matters: no check may take the mistake of an earlier one for its own. Each check has the
# names of the checks whose findings make it inconclusive.
FORMS = ("times", "box corners", "image size")
CHECKS: dict[str, tuple[Check, tuple[str, ...]]] = {
    "times": (check_times, ()),
    "box corners": (check_box_form, ()),
    "image size": (check_image_size, ("box corners",)),
    "poses": (check_poses, FORMS),
    "clock": (check_clock, (*FORMS, "poses")),
    "unexplained": (check_explained, (*FORMS, "poses", "clock")),
    "units": (check_units, (*FORMS, "poses", "unexplained")),
    "distortion": (check_distortion, (*FORMS, "poses", "clock", "unexplained")),
    "boxes": (check_boxes, ("box corners", "image size")),
    "doubles": (check_doubles, FORMS),
}


# What `dqslam run` checks first: what takes long, or what reading the boxes refuses, is left out.
FIRST_CHECKS = {
    name: CHECKS[name]
    for name in ("times", "image size", "poses", "clock", "unexplained", "units", "doubles")
} | {"clock": (check_clock_shortly, CHECKS["clock"][1])}
#: Findings with which files make no map.
FATAL = ("times", "image size", "poses")


@dataclass(frozen=True)
class Inspection:
    """The content of a recording, and the mistakes that were found in it."""

    summary: dict[str, Any]  #: ready for JSON
    findings: tuple[Finding, ...]
    unchecked: dict[str, str]  #: the reason why a check was inconclusive, by its name
    verdict: Verdict | None  #: how well poses explain the boxes; None if that cannot be told
    clock: ClockOffset | None  #: the offset of the clocks; None if that cannot be told
    notes: tuple[str, ...]  #: what is no mistake but worth a look


def inspect_recording(
    camera: _core.Camera,
    trajectory: Trajectory,
    table: DetectionTable,
    *,
    ids: Ids | None = None,
    max_time_difference: float | None = None,
) -> Inspection:
    """Summarize a recording and check it for the usual mistakes.

    Parameters
    ----------
    camera, trajectory
        Camera and trajectory as they were read.
    table
        Unchecked and uncut boxes, from ``read_detections(path, cut=False, check=False)``.
    ids
        The column of object ids; without it, boxes are joined by their overlap.
    max_time_difference
        The largest time from a box to its pose in seconds; by default half the median interval
        of poses.
    """
    evidence = Evidence.of(camera, trajectory, table, ids, max_time_difference)
    findings, unchecked = run_checks(evidence, CHECKS)
    verdict: Verdict | None = None
    clock: ClockOffset | None = None
    with contextlib.suppress(NotEnoughDataError):
        verdict = judge(evidence)
    if not any(name in findings for name in FORMS):
        with contextlib.suppress(NotEnoughDataError):
            clock = estimate_clock_offset(evidence)
    return Inspection(
        summarize(evidence),
        tuple(findings.values()),
        unchecked,
        verdict,
        clock,
        tuple(note_jumps(evidence)),
    )


def first_findings(
    camera: _core.Camera,
    trajectory: Trajectory,
    table: DetectionTable,
    *,
    ids: Ids | None = None,
    max_time_difference: float | None = None,
) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """Return the mistakes that a short check finds before a run, and notes.

    Parameters are those of ``inspect_recording``.
    """
    evidence = Evidence.of(camera, trajectory, table, ids, max_time_difference)
    findings, _ = run_checks(evidence, FIRST_CHECKS)
    return tuple(findings.values()), tuple(note_jumps(evidence))


def run_checks(
    evidence: Evidence, checks: dict[str, tuple[Check, tuple[str, ...]]]
) -> tuple[dict[str, Finding], dict[str, str]]:
    """Make checks in order; return what they find, and why others could not be made, by name."""
    findings: dict[str, Finding] = {}
    unchecked: dict[str, str] = {}
    for name, (check, after) in checks.items():
        found = [other for other in after if other in findings]
        if found:
            unchecked[name] = f"{found[0]} comes first"
            continue
        try:
            finding = check(evidence)
        except NotEnoughDataError as error:
            unchecked[name] = str(error)
            continue
        if finding is not None:
            findings[name] = finding
    return findings, unchecked
