"""Where objects are."""

import numpy as np
from numpy.random import Generator

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import PoseModel
from dqslam.simulation.path import TruePath
from dqslam.simulation.scenario import AlongPathSettings, InsidePathSettings, OnTableSettings

_TRIES = 200  # to find places that are far enough from the path


def inside_path(world: InsidePathSettings, poses: Floats, random: Generator) -> Floats:
    """Return centers inside the box around the path, (o, 3)."""
    low = poses[:, :2].min(axis=0) + world.margin_m
    high = poses[:, :2].max(axis=0) - world.margin_m
    if (low > high).any():
        raise ValueError(f"world.margin_m: {world.margin_m} m leaves no room inside the path")
    ground = random.uniform(low, high, size=(world.object_count, 2))
    height = random.normal(world.height_mean_m, world.height_sigma_m, size=(world.object_count, 1))
    return np.hstack([ground, height])


def along_path(world: AlongPathSettings, motion: TruePath, random: Generator) -> Floats:
    """Return centers beside the path, (o, 3); what is too near to the path is drawn again."""
    path, forward = motion.poses[:, :2], _forward(motion)
    ground = np.zeros((0, 2))
    for _ in range(_TRIES):
        pose = random.integers(len(path), size=world.object_count)
        distance = random.uniform(world.distance_min_m, world.distance_max_m, len(pose))
        is_left = random.random(len(pose)) < {"left": 1.0, "right": 0.0, "both": 0.5}[world.sides]
        left = np.column_stack([-forward[pose, 1], forward[pose, 0]])
        place = path[pose] + np.where(is_left, distance, -distance)[:, None] * left
        away = np.linalg.norm(place[:, None] - path, axis=2).min(axis=1)
        # The place that an object is beside is at the least distance itself, but for rounding.
        far_enough = away > world.distance_min_m - 1e-9
        ground = np.vstack([ground, place[far_enough]])[: world.object_count]
        if len(ground) == world.object_count:
            height = random.normal(0.0, world.height_sigma_m, size=(len(ground), 1))
            return np.hstack([ground, height])
    raise ValueError(
        f"world.distance_min_m: hardly a place beside the path is {world.distance_min_m} m from it"
    )


def above_table(world: OnTableSettings, random: Generator) -> Floats:
    """Return the points under the objects where they would rest, (o, 3)."""
    size = np.array([world.length_m, world.width_m])
    ground = random.uniform(-size / 2.0, size / 2.0, size=(world.object_count, 2))
    lift = random.uniform(0.0, world.lift_max_m, size=(world.object_count, 1))
    return np.hstack([ground, lift])


def _forward(motion: TruePath) -> Floats:
    """Return the horizontal directions of motion at all poses, (n, 2)."""
    if motion.pose_model == PoseModel.SE2:
        return np.column_stack([np.cos(motion.poses[:, 2]), np.sin(motion.poses[:, 2])])
    ahead = np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(motion.poses), 1))
    step = _core.compose(PoseModel.SE3, motion.poses, ahead)[:, :2] - motion.poses[:, :2]
    return np.asarray(step / np.linalg.norm(step, axis=1, keepdims=True))
