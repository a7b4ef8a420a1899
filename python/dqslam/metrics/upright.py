"""The upward direction of a world."""

import numpy as np

from dqslam._checks import Floats

# The weight of the second term below. It matters only where cameras never turn sideways.
_MEAN_WEIGHT = 0.03
_NEARLY = np.cos(np.radians(10.0))


def up_direction(world_from_camera: Floats) -> Floats:
    """Return the unit vector (3,) that is up in the world of poses (n, 7), held without roll.

    Without roll, the x axes r of the cameras are level for any tilt. Up is therefore the u that
    minimizes mean (r.u)^2 - w (m.u)^2, where m is the mean of the directions that are up in the
    images. If an axis of the world is less than 10 degrees off, that axis is returned.
    """
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(world_from_camera[:, 3:]).as_matrix()
    right, mean_up = turns[:, :, 0], -turns[:, :, 1].mean(axis=0)
    level = right.T @ right / len(right) - _MEAN_WEIGHT * np.outer(mean_up, mean_up)
    up = np.linalg.eigh(level)[1][:, 0]
    up = up if up @ mean_up >= 0.0 else -up
    axis = int(np.argmax(np.abs(up)))
    return np.asarray(np.sign(up[axis]) * np.eye(3)[axis] if np.abs(up[axis]) > _NEARLY else up)
