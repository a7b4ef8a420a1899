"""What a session takes for granted and what it knows: the data that its modules share."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.objects import Registry


@dataclass(frozen=True, eq=False)
class Settings:
    """What a session takes for granted."""

    camera: _core.Camera
    pose_model: _core.PoseModel
    solve_options: _core.SolveOptions
    box_noise: BoxNoise
    size_prior: SizePrior | SizePriors | None
    """Of new objects; None where it is learned from those that are found."""
    believes_ids: bool
    """Whether a box with an id shows that object, without being identified."""
    trust: float
    """The probability that an id stays with its object, of boxes that are identified."""
    estimates_noise: bool
    """Whether the level of the odometry's noise is estimated from boxes."""


@dataclass(eq=False)
class State:
    """What a session knows."""

    settings: Settings
    begin: tuple[Floats, Floats]
    """First pose and its covariance, as ``path_begin`` has them."""
    core: _core.Session
    """All poses and boxes, and the estimate."""
    registry: Registry
    """Which id each object of the core has."""
    store: KeyframeStore
    """Which object each box shows, of those that are identified."""
    timestamps: list[float] = field(default_factory=list)
    given_ids: list[Ints] = field(default_factory=list)
    """Ids that the boxes of each step came with, -1 for none."""
    shown: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Ids of the objects that the boxes of the last step show, -1 for one that waits."""

    def copy(self) -> State:
        """Return a state to be changed by itself; its steps are those of this one."""
        store = copy.copy(self.store)
        store.labels = store.labels.since(0)  # a step may add boxes to the others meanwhile
        return replace(
            self, core=self.core.clone(), registry=Registry(self.registry.ids), store=store
        )

    @property
    def prior(self) -> SizePrior | SizePriors:
        """The size prior of objects that come with their ids."""
        return self.settings.size_prior or SizePrior()

    @property
    def odometry_noise(self) -> OdometryNoise | None:
        """Of a step, where that is estimated."""
        return self.store.odometry_noise if self.settings.estimates_noise else None

    @property
    def left_out(self) -> dict[int, str]:
        """Ids of objects that do not fit a world at rest, and why."""
        return {self.registry.ids[row]: why for row, why in self.store.labels.left_out.items()}

    @property
    def object_rows(self) -> list[ObjectRow]:
        """Rows of the objects that are in the map: not left out, and called something by a box."""
        left_out, labels = self.store.labels.left_out, self.store.labels
        named = labels.box_counts
        votes = self.registry.votes
        return [
            ObjectRow(row)
            for row in range(self.core.num_objects)
            if row not in left_out and (votes[row] or (row < len(named) and named[row]))
        ]
