"""The settings and the state of a session, which its modules share."""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.online.inputs import CheckedBoxes
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.objects import Registry


@dataclass(frozen=True, eq=False)
class Settings:
    """The settings of a session."""

    camera: _core.Camera
    pose_model: _core.PoseModel
    solve_options: _core.SolveOptions
    box_noise: BoxNoise
    size_prior: SizePrior | SizePriors | None
    """Size prior of new objects; None if it is learned from earlier objects."""
    believes_ids: bool
    """Whether a box with an id shows that object, without a test."""
    trust: float
    """The probability that an id stays with its object, for boxes that are tested."""
    estimates_noise: bool
    """Whether the level of the odometry's noise is estimated from boxes."""


def with_loss(online: _core.OnlineOptions, loss_scale: float) -> _core.OnlineOptions:
    """Return the options with another scale of the loss on boxes."""
    names = [name for name in dir(online) if not name.startswith("_")]
    return _core.OnlineOptions(
        **{name: getattr(online, name) for name in names} | {"loss_scale": loss_scale}
    )


# What moves is looked for in so many of the last images.
RECENT_IMAGES = 40


@dataclass(frozen=True, eq=False)
class RecentStep:
    """What a step was given, as it was believed."""

    relative: Floats
    """From the step before, shape (d,)."""
    covariance: Floats
    """Shape (k, k)."""
    boxes: CheckedBoxes


@dataclass(eq=False)
class State:
    """The state of a session."""

    settings: Settings
    begin: tuple[Floats, Floats]
    """First pose and its covariance, see ``path_begin``."""
    core: _core.Session
    """All poses and boxes, and the estimate."""
    registry: Registry
    """The id of each object of the core."""
    store: KeyframeStore
    """The object that each box shows, for boxes that are tested."""
    odometry_end: Floats
    """Where odometry alone leads, shape (d,)."""
    embedding_size: int | None = None
    """How long the vectors of what boxes look like are, None before the first boxes."""
    timestamps: list[float] = field(default_factory=list)
    given_ids: list[Ints] = field(default_factory=list)
    """Given ids of the boxes of each step, -1 for none."""
    shown: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Ids of the objects that the boxes of the last step show, -1 for one that waits."""
    recent: deque[RecentStep] = field(default_factory=lambda: deque(maxlen=RECENT_IMAGES))
    """The last steps, in order."""

    def copy(self) -> State:
        """Return a copy that can be changed independently; it shares the lists of steps."""
        store = copy.copy(self.store)
        store.labels = store.labels.since(0)  # a step may add boxes to the others meanwhile
        return replace(
            self, core=self.core.clone(), registry=Registry(self.registry.ids), store=store
        )

    @property
    def prior(self) -> SizePrior | SizePriors:
        """The size prior of objects whose ids are given."""
        return self.settings.size_prior or SizePrior()

    @property
    def odometry_noise(self) -> OdometryNoise | None:
        """The estimated noise of a step; None if it is not estimated."""
        return self.store.odometry_noise if self.settings.estimates_noise else None

    @property
    def dropped(self) -> dict[int, str]:
        """Reasons why objects do not fit a world at rest, by id."""
        return {self.registry.ids[row]: why for row, why in self.store.labels.dropped.items()}

    @property
    def object_rows(self) -> list[ObjectRow]:
        """Rows of the objects in the map, which are not left out and have a box with a class."""
        dropped, labels = self.store.labels.dropped, self.store.labels
        named = labels.box_counts
        votes = self.registry.votes
        return [
            ObjectRow(row)
            for row in range(self.core.num_objects)
            if row not in dropped and (votes[row] or (row < len(named) and named[row]))
        ]
