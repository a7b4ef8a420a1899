"""The motion of several steps as one: composed, with its covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.association.noise import translation_axes
from dqslam.recording import pose_size, tangent_size

# A heading is the same without its whole turns; so many would lose its digits.
_MANY_TURNS_RAD = 1e3


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
    covariances: Floats
    """As the steps had it, for a sigma of 1 m a step, and for one of 1 rad a step, (3, k, k)."""

    @classmethod
    def of_no_steps(cls, pose_model: _core.PoseModel) -> IntegratedOdometry:
        """Stay where we are."""
        k = tangent_size(pose_model)
        return cls(identity_pose(pose_model), np.zeros((3, k, k)))

    def then(
        self, pose_model: _core.PoseModel, relative: Floats, covariance: Floats
    ) -> IntegratedOdometry:
        """Go on by a step."""
        k = len(covariance)
        is_translation = np.arange(k) < translation_axes(k)
        step = np.array([covariance, np.diag(is_translation), np.diag(~is_translation)])
        end = _core.compose(pose_model, self.relative[None], relative[None])[0]
        if pose_model == _core.PoseModel.SE2 and abs(end[2]) > _MANY_TURNS_RAD:
            end[2] = math.remainder(end[2], 2.0 * math.pi)
        moved = _core.adjoint(pose_model, _core.inverse(pose_model, relative[None]))[0]
        return IntegratedOdometry(end, moved @ self.covariances @ moved.T + step)
