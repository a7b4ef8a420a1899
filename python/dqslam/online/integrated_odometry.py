"""The way from one keyframe to the next: the motion of its steps composed, and its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats


@dataclass(frozen=True, eq=False)
class Leg:
    """Steps composed."""

    relative: Floats
    """End in start, shape (d,)."""
    covariance: Floats
    """As the steps had it, shape (k, k)."""
    per_translation: Floats
    """For a sigma of 1 m a step, shape (k, k)."""
    per_rotation: Floats
    """For a sigma of 1 rad a step, shape (k, k)."""

    @classmethod
    def of_no_steps(cls, pose_model: _core.PoseModel) -> Leg:
        """Stay where we are."""
        d, k = (3, 3) if pose_model == _core.PoseModel.SE2 else (7, 6)
        still = np.zeros(d)
        if pose_model == _core.PoseModel.SE3:
            still[-1] = 1.0
        nothing = np.zeros((k, k))
        return cls(still, nothing, nothing, nothing)

    def then(self, pose_model: _core.PoseModel, relative: Floats, covariance: Floats) -> Leg:
        """Go on by a step."""
        k = len(covariance)
        is_translation = np.arange(k) < (2 if k == 3 else 3)
        moved = _core.adjoint(pose_model, _core.inverse(pose_model, relative[None]))[0]
        before = (self.covariance, self.per_translation, self.per_rotation)
        step = (covariance, np.diag(is_translation * 1.0), np.diag(~is_translation * 1.0))
        return Leg(
            _core.compose(pose_model, self.relative[None], relative[None])[0],
            *(moved @ old @ moved.T + new for old, new in zip(before, step, strict=True)),
        )
