"""How well a path is known: by odometry alone, where no map that may be wrong has a say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.io.results.covariances import motion_of_camera
from dqslam.recording import Odometry, Recording

PathCovariance = Callable[[Ints], Floats | None]
"""Joint covariance (6 n, 6 n) of small motions [m, rad] of the cameras at poses (n,), each in its
own frame; None where it is unknown."""


def reckoned_covariance(odometry: Odometry, poses: Floats, images: Ints) -> Floats:
    """Return the joint covariance (k n, k n) of dead-reckoned poses, of which the first is exact.

    It is of small motions of the poses (m, d) at ``images`` (n,), ascending, each in its own frame,
    by the noise of the steps that lead to them.
    """
    model = odometry.pose_model
    steps = np.arange(images[-1])
    # A small motion of a pose, in the frame of the next one.
    onward = _core.adjoint(model, _core.between(model, poses[steps + 1], poses[steps]))
    size = odometry.covariance.shape[1]
    spread = np.zeros((len(steps) + 1, size, size))
    for row, step in enumerate(steps.tolist()):
        spread[row + 1] = onward[row] @ spread[row] @ onward[row].T + odometry.covariance[step]
    spread = spread[images]
    # What moves an image moves those after it along, too.
    before, after = np.tril_indices(len(images))[::-1]
    along = _core.adjoint(model, _core.between(model, poses[images[after]], poses[images[before]]))
    block = along @ spread[before]
    joint = np.zeros((len(images), size, len(images), size))
    joint[after, :, before, :] = block
    joint[before, :, after, :] = block.transpose(0, 2, 1)
    return joint.reshape(len(images) * size, -1)


def path_by_odometry(recording: Recording) -> tuple[Floats, PathCovariance]:
    """Return the path of the odometry of a recording alone, (n, d), and its covariance."""
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    motion = motion_of_camera(odometry.pose_model, recording.camera)
    return path, lambda images: of_cameras(reckoned_covariance(odometry, path, images), motion)


def of_cameras(spread: Floats, motion: Floats) -> Floats:
    """Turn the joint covariance of n poses, (k n, k n), into that of their cameras, (6 n, 6 n).

    ``motion`` (6, k) is the motion of a camera by that of its pose.
    """
    count = len(spread) // motion.shape[1]
    blocks = spread.reshape(count, -1, count, motion.shape[1])
    moved = np.einsum("ab,ibjc,dc->iajd", motion, blocks, motion, optimize=True)
    return np.asarray(moved).reshape(6 * count, 6 * count)
