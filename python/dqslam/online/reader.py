"""What a session tells at any time: its estimate, its objects, what its boxes show."""

from __future__ import annotations

from threading import RLock

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._repr import counted
from dqslam.assumptions import OdometryNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.online.locked import locked
from dqslam.online.moving import track_recent
from dqslam.online.objects import Objects
from dqslam.online.readout import read_assignments, read_estimate, read_objects
from dqslam.online.state import State
from dqslam.recording import tangent_size
from dqslam.track import Track


class SessionReader:
    """The part of a session that reads. Each answer is of the time between two steps, whole."""

    pose_model: _core.PoseModel
    _state: State
    _lock: RLock

    @locked
    def __repr__(self) -> str:
        """Show the pose model, and how many steps and objects there are."""
        steps, objects = counted(len(self), "step"), counted(self.num_objects, "object")
        return f"OnlineSlam({self.pose_model.name}, {steps}, {objects})"

    @locked
    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._state.timestamps)

    @property
    @locked
    def timestamps(self) -> Floats:
        """Seconds, shape (n,)."""
        return np.array(self._state.timestamps)

    @property
    @locked
    def pose(self) -> Floats:
        """world_from_robot of the last step, shape (d,); the first pose before any step."""
        if not len(self):
            return self._state.begin[0]
        return np.asarray(self._state.core.pose_at(len(self) - 1))

    @property
    @locked
    def pose_covariance(self) -> Floats:
        """Covariance of ``pose``, shape (k, k), translation [m] before rotation [rad].

        It is in the frame of the pose, as ``Marginals.poses`` is. Before any step, it is that of
        the first pose, and zero if that is exact.
        """
        if len(self):
            return self._state.core.last_covariance
        k = tangent_size(self.pose_model)
        given = self._state.begin[1]
        return given.copy() if given.size else np.zeros((k, k))

    @property
    @locked
    def poses(self) -> Floats:
        """world_from_robot of every step, shape (n, d)."""
        return self._state.core.poses

    @property
    @locked
    def objects(self) -> Objects:
        """The present estimate of the objects."""
        return read_objects(self._state)

    @property
    @locked
    def num_objects(self) -> int:
        """The number of objects."""
        return len(self._state.object_rows)

    @property
    @locked
    def dropped(self) -> dict[int, str]:
        """Reasons why objects do not fit a world at rest, by id; their boxes are not used."""
        return self._state.dropped

    @property
    @locked
    def shown(self) -> Ints:
        """Id of the object that each box of the last step shows, -1 if it waits; shape (b,)."""
        return self._state.shown.copy()

    @property
    @locked
    def assignments(self) -> list[Ints]:
        """Id of the object that each box of each step shows, as known now; -1 for none."""
        return read_assignments(self._state)

    @property
    @locked
    def keyframes(self) -> Ints:
        """Steps that are keyframes of the association, shape (f,)."""
        return np.array([one.pose for one in self._state.store.keyframes], dtype=np.int64)

    @property
    @locked
    def size_prior(self) -> SizePrior | SizePriors:
        """The size prior of new objects, which is given or learned from earlier objects."""
        return self._state.store.size_prior or self._state.prior

    @property
    @locked
    def odometry_noise(self) -> OdometryNoise | None:
        """The estimated noise of a step; None if it is not estimated."""
        return self._state.odometry_noise

    @locked
    def tracks(self) -> tuple[Track, ...]:
        """Return what moves in the last 40 images: where it was in each, and how fast.

        The last row of a track is where it was last seen: ``track.pose[-1]`` is the step. Things
        are judged anew each time, so that ``track_id`` names them in one answer only. The work is
        bounded by these images and by how many things they show, and it is done here, not in
        ``add``. A class whose size is unknown has no tracks, see docs/tracks.md.
        """
        return track_recent(self._state)

    @locked
    def estimate(self) -> Estimate:
        """Return the estimate in the form of ``solve``, with objects by ascending ids."""
        return read_estimate(self._state)
