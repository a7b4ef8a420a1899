"""Whether boxes and poses share a clock."""

from __future__ import annotations

from dqslam.inspect_recording.evidence import Evidence, Finding, Floats

# What a clock may count instead of seconds.
UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}


def check_times(evidence: Evidence) -> Finding | None:
    """Compare the spans of poses and boxes, in seconds and in other units."""
    poses, boxes = evidence.trajectory.timestamps, evidence.table.timestamp
    if evidence.timely.any():
        return None
    span = f"boxes {_span(boxes)}, poses {_span(poses)}"
    if _overlap(poses, boxes):
        tolerance = evidence.tolerance
        return Finding("times", f"no box has a pose within {tolerance:g} s of it: {span}")
    for unit, seconds in UNITS.items():
        for name, other in (
            ("boxes", (poses, boxes * seconds)),
            ("poses", (poses * seconds, boxes)),
        ):
            if _overlap(*other):
                return Finding("times", f"times of the {name} look like {unit}: {span}")
    return Finding("times", f"no box is of the time of any pose: {span}")


def _overlap(poses: Floats, boxes: Floats) -> bool:
    return bool(poses.min() <= boxes.max() and boxes.min() <= poses.max())


def _span(times: Floats) -> str:
    return f"{times.min():.6f} to {times.max():.6f} s"
