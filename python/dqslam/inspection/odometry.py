"""What is odd about the poses themselves, or about boxes, whatever explains them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError
from dqslam.inspection.pose_checks import NOISY
from dqslam.inspection.tracks import doubles
from dqslam.inspection.usual_sizes import USUAL_M, size_factor
from dqslam.inspection.windows import LENGTHS
from dqslam.io import Trajectory
from dqslam.io.span import seconds as seconds_of

# Lengths have another unit if half of the objects are larger or smaller [m], or if the camera is
# faster half of the time than cars and drones are [m/s].
LARGEST_M, SMALLEST_M, FASTEST_M_S = 20.0, 5e-4, 40.0
UNITS = {"millimeters": 1e-3, "centimeters": 1e-2, "kilometers": 1e3}
# Known classes tell these as well.
CLOSE_UNITS = UNITS | {"inches": 0.0254, "feet": 0.3048}
USUAL_RANGE_M = (0.01, 10.0)
MOST_NAMED = 4
LIKE = 1.8  #: a unit is likely if sizes are usual in it to within this factor
# A step is a jump if it is so many times as long, or as fast, as nine tenths of all steps.
JUMP, FAST = 6.0, 4.0
GAP = 3.0  #: median intervals that make a gap
FEWEST_POSES = 10  #: that tell what is usual
# The share of boxes that repeat another one.
MOST_DOUBLES = 0.1


def check_units(evidence: Evidence) -> Finding | None:
    """Check whether objects have usual sizes, and the camera a usual speed, in meters."""
    views = evidence.windows()
    if views.given.unexplained > NOISY:
        raise NotEnoughDataError("the poses do not explain the boxes")
    fit = views.fit()
    rows, there = views.windows.rows, views.windows.there & (views.windows.length > 0)[:, None]
    if not there.any():
        there = views.windows.there
    box = evidence.table.box[rows]
    side = np.sqrt(np.prod(np.abs(box[..., 2:] - box[..., :2]), axis=-1)) / evidence.camera.fx
    known = there & np.isfinite(fit.depth) & (fit.depth > 0)
    size = (side * fit.depth)[known]
    if size.size < len(LENGTHS):
        raise NotEnoughDataError("no object has a known distance")
    usual = float(np.median(size))
    times, poses = evidence.trajectory
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    speed = float(np.median(steps / np.diff(times)))
    names = np.array(evidence.table.class_name, dtype=object)[rows[known]]
    classes = {name: float(np.median(size[names == name])) for name in set(names.tolist())}
    factor = size_factor(classes)
    if factor is not None:
        return _of_classes(factor, classes)
    if SMALLEST_M <= usual <= LARGEST_M and speed <= FASTEST_M_S:
        return None
    likely = [
        f"{unit} (--length-scale {meters:g})"
        for unit, meters in UNITS.items()
        if USUAL_RANGE_M[0] <= usual * meters <= USUAL_RANGE_M[1]
    ]
    meant = f": they may be {' or '.join(likely)}" if likely else ""
    return Finding(
        "units",
        f"objects would be {usual:.3g} m large, the path {steps.sum():.3g} m long, and the camera "
        f"{speed:.3g} m/s fast, if the positions of the poses were meters{meant}",
    )


def _of_classes(factor: float, classes: dict[str, float]) -> Finding:
    """Return the finding that objects of well-known classes have sizes that they never have."""
    named = [name for name in sorted(classes) if name in USUAL_M][:MOST_NAMED]
    shown = ", ".join(f"{name} {classes[name]:.2g} m" for name in named)
    likely = [
        f"{unit} (--length-scale {meters:g})"
        for unit, meters in CLOSE_UNITS.items()
        if abs(np.log(factor * meters)) <= np.log(LIKE)
    ]
    meant = f": they may be {' or '.join(likely)}" if likely else ""
    return Finding(
        "units",
        f"objects would be {factor:.2g} times as large as usual ({shown}) if the positions of the "
        f"poses were meters{meant}",
    )


def check_doubles(evidence: Evidence) -> Finding | None:
    """Check whether objects have several boxes in one image."""
    table = evidence.table
    double = float(np.mean(doubles(table, np.arange(len(table)))))
    if double < MOST_DOUBLES:
        return None
    return Finding(
        "doubles",
        f"{double:.0%} of the boxes overlap another one of their class in the same image: was "
        "non-maximum suppression left out? Each object needs one box an image",
    )


@dataclass(frozen=True)
class Jumps:
    """Steps of the odometry that are far longer than usual."""

    jumps: Bools  #: (n - 1,) steps that are too fast as well
    gaps: Bools  #: (n - 1,) others, which cross a gap in time
    length: Floats  #: (n - 1,) of all steps, m
    usual: float  #: nine tenths of all steps are not longer [m]


def find_jumps(trajectory: Trajectory) -> Jumps:
    """Find where a trajectory jumps, or has a gap that it crosses in one step."""
    times, poses = trajectory
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    seconds = np.diff(times)
    if len(times) < FEWEST_POSES:
        none = np.zeros(len(steps), dtype=bool)
        return Jumps(none, none, steps, 0.0)
    usual, fast = float(np.quantile(steps, 0.9)), np.quantile(steps / seconds, 0.9)
    jumps = (steps > JUMP * usual) & (steps / seconds > FAST * fast)
    gaps = (seconds > GAP * np.median(seconds)) & (steps > GAP * usual) & ~jumps
    return Jumps(jumps, gaps, steps, usual)


def note_jumps(evidence: Evidence) -> list[str]:
    """Say where the odometry jumps, or has a gap that it crosses in one step."""
    times = evidence.trajectory.timestamps
    seconds = np.diff(times)
    odd = find_jumps(evidence.trajectory)
    steps = odd.length
    notes = []
    for found, what in ((odd.jumps, "jumps"), (odd.gaps, "has a gap")):
        rows = np.flatnonzero(found)
        if rows.size:
            row = int(rows[np.argmax(steps[rows])])
            notes.append(
                f"the odometry {what} {rows.size} time{'s' if rows.size > 1 else ''}: at "
                f"{seconds_of(times[row])} s it moves by {steps[row]:.3g} m in "
                f"{seconds[row]:.3g} s, usually by {odd.usual:.2g} m at most. If it was lost "
                "there, --odometry-covariance says how uncertain that step is"
            )
    return notes
