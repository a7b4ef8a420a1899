"""The motion of a robot from pose to pose, as it was measured."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, Ints, as_covariances, as_floats, assign
from dqslam._repr import counted
from dqslam.recording.poses import as_poses, pose_model_of, tangent_size


@dataclass(frozen=True, eq=False)
class Odometry:
    """Relative motions between successive poses."""

    pose_model: _core.PoseModel
    first_pose: Floats
    """world_from_robot of pose 0, shape (d,)."""
    relative: Floats
    """next_in_previous, shape (n - 1, d)."""
    covariance: Floats
    """Covariance in the tangent at `relative`, shape (n - 1, k, k).

    Translation [m] is first, then rotation [rad], both in the frame of the next pose.
    """

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        model = self.pose_model
        first_pose = as_poses("odometry.first_pose", np.atleast_2d(self.first_pose), model)
        if len(first_pose) != 1:
            raise ValueError(f"odometry.first_pose: expected one pose, got {len(first_pose)}")
        relative = as_poses("odometry.relative", self.relative, model)
        covariance = as_covariances(
            "odometry.covariance", self.covariance, len(relative), tangent_size(model)
        )
        assign(self, first_pose=first_pose[0], relative=relative, covariance=covariance)

    @classmethod
    def from_poses(cls, poses: ArrayLike, *, covariance: ArrayLike) -> Self:
        """Make odometry from the poses that it has led to.

        Parameters
        ----------
        poses
            world_from_robot, shape (n, 3) for [x, y, theta] or (n, 7) for [tx, ty, tz, qx, qy, qz,
            qw]. The width selects the pose model.
        covariance
            Covariance of every step, shape (k, k), or of each step, shape (n - 1, k, k).

        Examples
        --------
        A robot drives two meters, then one more while it turns left. Each step has a sigma of 2 cm
        along each axis and of 0.01 rad:

        >>> import dqslam as dq
        >>> import numpy as np
        >>> poses = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.5]]
        >>> odometry = dq.Odometry.from_poses(poses, covariance=np.diag([0.02, 0.02, 0.01]) ** 2)
        >>> odometry
        Odometry(SE2, 2 steps)
        >>> odometry.relative.tolist()
        [[2.0, 0.0, 0.0], [1.0, 0.0, 0.5]]
        """
        model = pose_model_of("poses", poses)
        path = as_poses("poses", poses, model)
        if not len(path):
            raise ValueError("poses: there are none")
        if np.ndim(covariance) == 2:
            k = tangent_size(model)
            one = as_floats("odometry.covariance", covariance, [k, k])
            covariance = np.tile(one, (len(path) - 1, 1, 1))
        relative = _core.between(model, path[:-1], path[1:])
        return cls(model, path[0], relative, np.asarray(covariance))

    def __repr__(self) -> str:
        """Show the pose model and how many steps there are."""
        return f"Odometry({self.pose_model.name}, {counted(len(self.relative), 'step')})"

    def with_scale_drift(self, sigma: float, length_m: float) -> Self:
        """Return the odometry with a covariance that allows for a scale that drifts slowly.

        The scale wanders about its mean with a standard deviation of ``sigma``, a share, and is
        forgotten over ``length_m`` meters of the path. Over longer distances d, the error along the
        path then grows like that of independent steps with a variance of 2 sigma^2 length_m d, and
        each step gets its part of it, in the direction of its motion.

        Raises
        ------
        ValueError
            If ``sigma`` is negative, or ``length_m`` is not positive.

        Examples
        --------
        >>> import dqslam as dq
        >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
        >>> odometry = recording.odometry.with_scale_drift(0.05, length_m=20.0)
        >>> float(round(odometry.covariance[0, 0, 0] - recording.odometry.covariance[0, 0, 0], 4))
        0.05
        """
        if not sigma >= 0.0:
            raise ValueError(f"scale drift: sigma is {sigma:g}, negative")
        if not length_m > 0.0:
            raise ValueError(f"scale drift: length is {length_m:g} m, not positive")
        # The covariance is in the frame of the next pose: the translation is turned into it.
        size = 2 if self.pose_model == _core.PoseModel.SE2 else 3
        back = _core.inverse(self.pose_model, self.relative)[:, :size]
        length = np.linalg.norm(back, axis=1)[:, None]
        along = np.divide(back, length, out=np.zeros_like(back), where=length > 0.0)
        added = np.zeros_like(self.covariance)
        added[:, :size, :size] = along[:, :, None] * along[:, None, :] * length[:, :, None]
        return replace(self, covariance=self.covariance + 2.0 * sigma**2 * length_m * added)


def compose_covariance(odometry: Odometry, covariance: Floats, keyframes: Ints) -> Floats:
    """Return the covariance of the motion between keyframes from that of each step, (n - 1, k, k).

    As many as there are keyframes, ascending, less one: shape (f - 1, k, k).
    """
    model = odometry.pose_model
    path = _core.dead_reckon(model, odometry.first_pose, odometry.relative)
    ends = np.repeat(keyframes[1:], np.diff(keyframes))
    steps = np.arange(keyframes[0], keyframes[-1])
    # The error of a step, at its end, is one of the next keyframe as seen from there.
    end_from_step = _core.between(model, path[ends], path[steps + 1])
    moved = _core.adjoint(model, end_from_step)
    spread = moved @ covariance[steps] @ moved.transpose(0, 2, 1)
    return np.asarray(np.add.reduceat(spread, keyframes[:-1] - keyframes[0], axis=0))
