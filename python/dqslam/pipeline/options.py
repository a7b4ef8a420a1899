"""What may be chosen of a run: of a recording in memory, and of one in files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from dqslam import _core
from dqslam.association import FINAL
from dqslam.assumptions import (
    BoxNoise,
    ClassShapes,
    OdometryNoise,
    PlacementRules,
    SizePrior,
    SizePriors,
)
from dqslam.io import Extras, ReadOptions
from dqslam.io.recording import Ids
from dqslam.online import OnlineSlam, Step

Progress = Callable[[float, str], None]
"""Called with the share of the work that is done, 0 to 1, and a line on the step of a session."""
Watch = Callable[[OnlineSlam, Step], None]
"""Called with a session and the step that it has just taken."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What may be chosen of a run."""

    trust_ids: float = FINAL
    """Probability that an object id stays with its object, above 0.5; at 1 the ids are final.
    A recording without any ids does not use it."""
    mode: _core.Mode = _core.Mode.SLAM
    """SLAM improves the odometry; MAPPING takes it for the truth."""
    box_noise: BoxNoise | None = None
    """How far the edges of boxes are off, anew in each image. None begins with ``BoxNoise()``, and
    estimates in the end how far they are off, and what of that repeats from view to view."""
    size_prior: SizePrior | SizePriors | None = None
    """How large objects are, all of them or by class; None learns one size from those found."""
    shapes: _core.Shape | ClassShapes | Mapping[str, _core.Shape] | None = None
    """Shape of all objects, or by class, as ``build_graph`` takes it. With AUTO, an object is a
    cuboid or a cylinder where that predicts boxes better that took no part. None is ELLIPSOID."""
    placements: PlacementRules | None = None
    """Where objects of a class are, as ``load_placements`` reads it. Up is z unless the
    rules say another direction, or the cameras are held in another way; then it is estimated."""
    estimates_noise: bool = False
    """Whether the level of the odometry's noise is estimated instead of believed."""
    estimate: tuple[str, ...] = ()
    """Parameters of the calibration to estimate with all else, as ``solve_with_calibration`` names
    them: "mount", "focal", "odometry_scale", "gyro_bias", "time_offset", ..."""
    hold_out: float = 0.0
    """Share of the boxes, at least 0 and below 1, that the map is tested on instead."""
    seed: int = 0
    """Seed of the random choice of these boxes."""
    threads: int = 1
    """The most threads of the solver, at least 1; the result is the same with any number."""
    watch: Watch | None = None
    """Called after each step of a session; if the calibration is estimated, in each replay."""

    def solve_options(self) -> _core.SolveOptions:
        """Return the solver's options: its loss forgives boxes that show something else."""
        return _core.SolveOptions(
            mode=self.mode, loss=_core.Loss.CAUCHY, loss_scale=2.0, threads=self.threads
        )


@dataclass(frozen=True, kw_only=True)
class RunFilesOptions(RunOptions):
    """What may be chosen of a run and of how its files are read.

    The level of the odometry's noise is estimated if none of the three fields about it is set.
    """

    ids: Ids = "track_id"
    """Column that tells which boxes show the same object; with "none" it is found out."""
    min_score: float = 0.5
    """Least score of a box, 0 to 1; boxes below are left out."""
    extras: Extras = Extras()
    """Files of positions of objects, of absolute positions and of loop closures."""
    reading: ReadOptions = ReadOptions()
    """How the files are read: formats, times of frames, bad records, what numbers mean, ... Without
    times of frames, their numbers are seconds where the trajectory counts frames, too."""
    force: bool = False
    """Whether to go on if poses and boxes do not fit together, or would in another reading."""
    strict: bool = False
    """Whether every warning of the checks of the files refuses them, not only of what makes no map.
    Bad records are refused with ``ReadOptions(max_bad=0)``."""
    added_noise: OdometryNoise | None = None
    """Noise to add to every step of the odometry, drawn with ``seed``."""
    odometry_noise: OdometryNoise | None = None
    """What to believe of every step; None is the noise that was added, if any was."""
    odometry_covariance: str | Path | None = None
    """CSV of the covariance of each step, m and rad squared; it replaces ``odometry_noise``."""

    @property
    def believed_noise(self) -> OdometryNoise | None:
        """What is believed of every step, if one noise is believed of all."""
        return None if self.odometry_covariance else self.odometry_noise or self.added_noise
