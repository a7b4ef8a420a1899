"""How things move on the ground: along their heading, with a speed and a turn rate that wander.

A state is x, y [m], the height of the foot above the ground in sigmas, the heading [rad], the speed
[m/s] along it, and the turn rate [rad/s]. Speed and turn rate change by white noise of a density.
What rests has neither speed nor turn rate.
"""

from __future__ import annotations

from dqslam import _core

X, Y, ABOVE, HEADING, SPEED, TURN = range(6)
SIZE = 6
"""Numbers in a state."""

VEHICLE = _core.MotionNoise(1.0, 0.15, 0.05, 12.0, 0.2)
CYCLE = _core.MotionNoise(1.0, 0.3, 0.1, 6.0, 0.3)
PERSON = _core.MotionNoise(0.5, 0.7, 0.1, 1.5, 0.5)
ANYTHING = _core.MotionNoise(1.0, 0.5, 0.1, 4.0, 0.5)

_OF_CLASS = (
    dict.fromkeys(("car", "van", "truck", "bus", "tram"), VEHICLE)
    | dict.fromkeys(("bicycle", "cyclist", "motorcycle"), CYCLE)
    | dict.fromkeys(("person", "pedestrian"), PERSON)
)


def motion_noise(class_name: str) -> _core.MotionNoise:
    """Return how things of a class move; a class without a known motion has a broad one."""
    return _OF_CLASS.get(class_name.lower(), ANYTHING)
