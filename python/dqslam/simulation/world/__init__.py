"""The objects of a world: where they are, and how large."""

from dqslam.simulation.world.draw import World as World
from dqslam.simulation.world.draw import draw_world as draw_world
from dqslam.simulation.world.truth import true_answer as true_answer
