"""The motion of several steps as one: composed, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.association.noise import translation_axes
from dqslam.association.thinning import transport
from dqslam.recording import pose_size, tangent_size


def identity_pose(pose_model: _core.PoseModel) -> Floats:
    """Return the pose of the world itself, shape (d,)."""
    pose = np.zeros(pose_size(pose_model))
    if pose_model == _core.PoseModel.SE3:
        pose[-1] = 1.0
    return pose


@dataclass(frozen=True, eq=False)
class IntegratedOdometry:
    """From the pose before the steps to the one after them."""

    relative: Floats
    """End in start, shape (d,)."""
    covariance: Floats
    """As the steps had it, shape (k, k)."""
    per_translation: Floats
    """For a sigma of 1 m a step, shape (k, k)."""
    per_rotation: Floats
    """For a sigma of 1 rad a step, shape (k, k)."""

    @classmethod
    def of_no_steps(cls, pose_model: _core.PoseModel) -> IntegratedOdometry:
        """Stay where we are."""
        nothing = np.zeros((tangent_size(pose_model),) * 2)
        return cls(identity_pose(pose_model), nothing, nothing, nothing)

    def then(
        self, pose_model: _core.PoseModel, relative: Floats, covariance: Floats
    ) -> IntegratedOdometry:
        """Go on by a step."""
        k = len(covariance)
        is_translation = np.arange(k) < translation_axes(k)
        moved = transport(pose_model, relative[None])[0]
        before = (self.covariance, self.per_translation, self.per_rotation)
        step = (covariance, np.diag(is_translation * 1.0), np.diag(~is_translation * 1.0))
        return IntegratedOdometry(
            _core.compose(pose_model, self.relative[None], relative[None])[0],
            *(moved @ old @ moved.T + new for old, new in zip(before, step, strict=True)),
        )
