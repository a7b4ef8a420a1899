"""Whether the poses explain where the boxes are, and which other reading of them would."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dqslam.inspection.comparison import (
    Explanation,
    PoseReading,
    WindowViews,
    alike,
    clearly_better,
)
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError, median_residual
from dqslam.inspection.pose_readings import describe, unusual_readings, usual_readings
from dqslam.inspection.rays import BEHIND_PX

# The share of the motion of boxes that poses leave unexplained: at most GOOD where files are right
# and odometry is as usual, NOISY with much noise. Above it, and above SUSPECT where what is left
# persists from view to view, nothing is explained.
GOOD, SUSPECT, NOISY = 0.35, 0.15, 0.6
# Less than this is left by no other reading: they need not be tried.
WELL = 0.1
# Boxes keep their motion from view to view where images are dense. Only there can noise be told
# from a wrong reading. Differences of the noise of single poses, not of steps, are below LEAST.
DENSE, APART, NOISE, LEAST = 0.15, 0.2, 0.2, -0.3
# What persists to a larger degree is no noise at all.
SYSTEMATIC = 0.25
# With fewer windows, and no more to judge by, nothing is said.
FEWEST_SURE = 40
# What is left of noise by another reading must be a smaller share of it.
FAR_LESS = 0.5
MOST_NAMED = 3
STILL = 1e-6  #: poses whose numbers differ by less are the same


@dataclass(frozen=True)
class Verdict:
    """How well the poses explain where the boxes are."""

    unexplained: float
    """The share of the motion of boxes that is left, in windows of the length that suits best."""
    short_px: float
    """Median distance of middles from the point that explains them, in short windows [px]."""
    short_motion_px: float
    """Median motion of middles in these windows [px]."""
    track_px: float | None
    """The same over whole tracks: the median ray miss; None without parallax."""
    persistence: float
    """Of what is left, from view to view: -1 to 1; noise is below 0.1. NaN if unknown."""
    smoothness: float
    """The same of the boxes themselves, above 0.25 where images are dense. NaN if unknown."""
    windows: int
    """Number of windows."""

    @property
    def explained(self) -> Literal["yes", "partly", "noisy", "unsure", "no"]:
        """Whether the poses explain the boxes, or noise or a lack of data hides that."""
        if self.unexplained > NOISY:
            if is_noise(self.persistence, self.smoothness) and self.persistence >= LEAST:
                return "noisy"
            few = np.isnan(self.smoothness) and self.windows < FEWEST_SURE
            return "unsure" if few else "no"
        if self.unexplained > SUSPECT and self.persistence > SYSTEMATIC:
            return "no"
        return "yes" if self.unexplained <= GOOD else "partly"


def is_noise(persistence: float, smoothness: float) -> bool:
    """Tell whether what is left is noise, in boxes that move smoothly enough to tell."""
    return persistence <= NOISE and smoothness >= max(DENSE, persistence + APART)


def judge(evidence: Evidence) -> Verdict:
    """Say how well the poses explain where the boxes are.

    Raises
    ------
    NotEnoughDataError
        If no object is seen often enough while it moves through the image.
    """
    tracks = evidence.tracks()
    views = evidence.windows()
    given = views.given
    short = views.windows.length == views.windows.length.min()
    try:
        whole: float | None = median_residual(evidence.camera, evidence.views(tracks))
    except NotEnoughDataError:
        whole = None
    focal = evidence.camera.fx
    return Verdict(
        unexplained=given.unexplained,
        short_px=float(np.median(given.miss[short])) * focal,
        short_motion_px=float(np.median(views.motion[short])) * focal,
        track_px=whole,
        persistence=given.persistence,
        smoothness=views.smoothness,
        windows=len(views.windows),
    )


def check_poses(evidence: Evidence) -> Finding | None:
    """Compare the poses as given with other readings of them, by the motion they explain."""
    views = evidence.windows()
    given = views.given
    if given.unexplained <= WELL and not given.persistence > NOISE:
        return None
    noise = is_noise(given.persistence, views.smoothness)
    unsure = noise or bool(np.isnan(given.persistence) or np.isnan(views.smoothness))
    best = best_readings(views, given, usual_readings())
    if not unsure and (not best or best[0][1].unexplained > WELL):
        first = best[0][1] if best else given
        best = best_readings(views, first, unusual_readings()) or best
    # If nothing but noise is left, or that is not known, another reading must leave far less.
    most = min(GOOD, FAR_LESS * given.unexplained) if unsure else NOISY
    if not best or best[0][1].unexplained > most:
        return None
    named = [describe(reading) for reading, _ in best[:MOST_NAMED]]
    return Finding(
        "poses",
        f"the poses look like {'; or '.join(named)}. They leave "
        f"{best[0][1].unexplained:.0%} of the boxes' motion unexplained then, "
        f"{given.unexplained:.0%} as they are",
    )


def best_readings(
    views: WindowViews, given: Explanation, readings: Iterable[PoseReading]
) -> list[tuple[PoseReading, Explanation]]:
    """Return the best of the readings that are clearly better, and those that are as good."""
    found = [(reading, views.explanation(reading)) for reading in readings]
    better = [one for one in found if clearly_better(given, one[1])]
    if not better:
        return []
    order = sorted(better, key=lambda one: float(one[1].log_share.mean()))
    first = order[0][1]
    # Of readings that are as good, the first in the list is the simplest.
    return [one for one in better if one[1] is first or alike(first, one[1])]


def check_explained(evidence: Evidence) -> Finding | None:
    """Check whether the poses explain the motion of the boxes at all."""
    verdict = judge(evidence)
    if verdict.explained == "noisy":
        raise NotEnoughDataError(
            f"the odometry is as noisy as the boxes' motion is large ({verdict.unexplained:.0%} of "
            "it is unexplained): readings cannot be told apart"
        )
    if verdict.explained == "unsure":
        raise NotEnoughDataError(
            f"the poses leave {verdict.unexplained:.0%} of the boxes' motion unexplained, but few "
            "boxes move: are the files right?"
        )
    if verdict.explained != "no":
        return None
    poses = evidence.trajectory.world_from_camera
    if np.ptp(poses, axis=0).max() < STILL:
        return Finding("poses", "all poses are the same, but the boxes move through the image")
    turns = poses[:, 3:]
    if np.abs(turns - turns[0]).max() < STILL:
        return Finding(
            "poses",
            "all rotations are the same, and the boxes say that the camera turned: the file has "
            "positions only, it seems; rotations are needed",
        )
    return Finding(
        "unexplained",
        f"no reading of the files explains where the boxes are: the poses leave "
        f"{verdict.unexplained:.0%} of the boxes' motion unexplained, right files mostly less "
        f"than {GOOD:.0%} and only noise. Rays miss each other by {pixels(verdict.track_px)}",
    )


def pixels(value: float | None) -> str:
    """Say a distance in pixels."""
    if value is None:
        return "unknown"
    return "more than the image" if value >= BEHIND_PX else f"{value:.1f} px"
