"""The truth about a world and the path through it."""

import numpy as np

from dqslam import _core
from dqslam.recording import Truth
from dqslam.simulation.path import TruePath
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.world.draw import World


def true_answer(scenario: Scenario, motion: TruePath, world: World) -> Truth:
    """Return poses, objects and their volumes; cubes have no further parameters."""
    count = len(world.center)
    ellipsoids = cuboids = None
    if scenario.objects == "cubes":
        volume = world.side**3
    elif scenario.objects == "cuboids":
        volume = 8.0 * world.semi_axes.prod(axis=1)
        cuboids = np.hstack([world.center, world.semi_axes, world.orientation])
    else:
        rows = zip(world.center, world.semi_axes, world.orientation, strict=True)
        ellipsoids = np.array([_core.ellipsoid_from_axes(*row) for row in rows])
        volume = 4.0 / 3.0 * np.pi * world.semi_axes.prod(axis=1)
    return Truth(
        pose_model=motion.pose_model,
        poses=motion.poses,
        object_ids=np.arange(count),
        centers=world.center,
        volumes=volume,
        class_names=_class_names(
            scenario.objects.removesuffix("s"), scenario.world.class_count, count
        ),
        ellipsoids=ellipsoids,
        cuboids=cuboids,
    )


def _class_names(kind: str, classes: int, count: int) -> tuple[str, ...]:
    """Return the class of each object; they take turns."""
    names = [kind] if classes == 1 else [f"{kind}_{number}" for number in range(1, classes + 1)]
    return tuple(names[row % classes] for row in range(count))
