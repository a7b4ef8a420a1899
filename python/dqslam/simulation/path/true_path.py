"""The true path of a robot."""

from typing import NamedTuple

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import PoseModel


class TruePath(NamedTuple):
    """The true path; d is the pose size."""

    pose_model: PoseModel
    poses: Floats  # world_from_robot, (n, d)
    relative: Floats  # next_in_previous, (n - 1, d)
    is_turn: Bools  # whether a step turns, if the noise of odometry depends on it; (n - 1,)


def poses_later(motion: TruePath, steps: float) -> Floats:
    """Return where the robot is a number of steps after each of its poses, shape (n, d).

    Between two poses it moves evenly. Before the first and after the last pose it goes on as in
    the first and in the last step.
    """
    model, count = motion.pose_model, len(motion.poses)
    whole = int(np.floor(steps))
    row = np.clip(np.arange(count) + whole, 0, count - 2)
    share = np.arange(count) + steps - row
    step = _core.minus(model, motion.poses[row + 1], motion.poses[row])
    return np.asarray(_core.plus(model, motion.poses[row], step * share[:, None]))
