"""The objects of a world, drawn at random."""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dqslam._checks import Floats
from dqslam.simulation.path import TruePath
from dqslam.simulation.scenario import OnTableSettings, Scenario
from dqslam.simulation.world.places import above_table, along_path, inside_path
from dqslam.simulation.world.shapes import half_height, log_normal, proportioned

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_UP = [0.0, 0.0, 1.0]


class World(NamedTuple):
    """Objects of every kind at the same places."""

    center: Floats  # in the world, m, (o, 3)
    side: Floats  # of the cubes, m, (o,)
    yaw: Floats  # of the cubes, rad, (o,)
    semi_axes: Floats  # of the ellipsoids, and half the sides of the cuboids, m, (o, 3)
    orientation: Floats  # of both, world_from_object, quaternions, (o, 4)

    def cube_corners(self) -> Floats:
        """Return the corners of the cubes in the world, m, shape (o, 3, 8)."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec(np.outer(self.yaw, _UP)).as_matrix() @ _CORNERS.T
        return np.asarray(self.center[:, :, None] + self.side[:, None, None] * turned)

    def cuboid_corners(self) -> Floats:
        """Return the corners of the cuboids in the world, m, shape (o, 3, 8)."""
        from scipy.spatial.transform import Rotation

        in_object = 2.0 * self.semi_axes[:, :, None] * _CORNERS.T
        turned = Rotation.from_quat(self.orientation).as_matrix() @ in_object
        return np.asarray(self.center[:, :, None] + turned)


def draw_world(scenario: Scenario, motion: TruePath, random: Generator) -> World:
    """Place objects uniformly; every kind of object uses the same numbers."""
    world = scenario.world
    if world.kind == "inside_path":
        place = inside_path(world, motion.poses, random)
    elif world.kind == "along_path":
        place = along_path(world, motion, random)
    else:
        place = above_table(world, random)
    side = random.normal(world.side_mean_m, world.side_sigma_m, size=world.object_count)
    side = np.maximum(world.side_min_m, side)
    yaw = random.uniform(-np.pi, np.pi, size=world.object_count)
    factor = random.uniform(*world.semi_axis_factor, size=(world.object_count, 3))
    semi_axes = factor * side[:, None] / 2.0
    orientation = np.column_stack([np.zeros((len(yaw), 2)), np.sin(yaw / 2.0), np.cos(yaw / 2.0)])
    if world.log_normal_size is not None:
        semi_axes, orientation = log_normal(world.log_normal_size, world.object_count, random)
    elif world.proportions is not None:
        semi_axes, turn = proportioned(world.proportions, world.object_count, random)
        orientation = orientation if turn is None else turn
    if isinstance(world, OnTableSettings):
        height = half_height(scenario.objects, semi_axes, orientation)
        place[:, 2] += side / 2.0 if scenario.objects == "cubes" else height
    return World(place, side, yaw, semi_axes, orientation)
