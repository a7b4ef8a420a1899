"""Whether boxes and poses share a clock."""

from __future__ import annotations

import numpy as np

from dqslam.inspection.evidence import Evidence, Finding, Floats

# The units that a clock may count instead of seconds.
UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
# The common share of the longer span: at most the first with different units, and at least the
# second after a correction.
APART, TOGETHER = 0.01, 0.5
# The largest share of boxes without a pose that is no mistake.
MOST_LATE = 0.5


def check_times(evidence: Evidence) -> Finding | None:
    """Compare the time spans of poses and boxes, in seconds and with one of them in other units."""
    poses, boxes = evidence.trajectory.timestamps, evidence.table.timestamp
    span = f"boxes {_span(boxes)}, poses {_span(poses)}"
    if _common(poses, boxes) <= APART:
        for unit, seconds in UNITS.items():
            if _common(poses, boxes * seconds) >= TOGETHER:
                return Finding(
                    "times",
                    f"times of the boxes look like {unit}: {span}; --time-scale {seconds:g}",
                )
            if _common(poses * seconds, boxes) >= TOGETHER:
                return Finding(
                    "times",
                    f"times of the poses look like {unit}: {span}; change them in the file, or "
                    f"read those of the boxes with --time-scale {1 / seconds:g}",
                )
    late = int(np.sum(~evidence.timely))
    if evidence.timely.any():
        if late <= MOST_LATE * len(evidence.timely):
            return None
        return Finding(
            "times",
            f"{late} of {len(evidence.timely)} boxes have no pose within "
            f"{evidence.tolerance:.3g} s of them: {span}",
        )
    return Finding("times", f"no box has a pose within {evidence.tolerance:g} s of it: {span}")


def _common(poses: Floats, boxes: Floats) -> float:
    """Return the share of the longer span that both have in common."""
    common = min(poses.max(), boxes.max()) - max(poses.min(), boxes.min())
    longer = max(float(poses.max() - poses.min()), float(boxes.max() - boxes.min()))
    return max(0.0, float(common)) / longer


def _span(times: Floats) -> str:
    return f"{times.min():.6f} to {times.max():.6f} s"
