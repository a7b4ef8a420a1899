"""Which way is up."""

import numpy as np

from dqslam._checks import Floats

# Of the second term below: decides only where cameras never turn aside.
_MEAN_WEIGHT = 0.03
_NEARLY = np.cos(np.radians(10.0))


def up_direction(world_from_camera: Floats) -> Floats:
    """Return the unit vector (3,) that is up in the world of poses (n, 7), held without roll.

    Then the x axes r of the cameras are level, however these are tilted: up is the u that minimizes
    mean (r.u)^2 - w (m.u)^2, m being the mean of the directions that are up in the images. An axis
    of the world that is less than 10 degrees off stands for it.
    """
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(world_from_camera[:, 3:]).as_matrix()
    right, mean_up = turns[:, :, 0], -turns[:, :, 1].mean(axis=0)
    level = right.T @ right / len(right) - _MEAN_WEIGHT * np.outer(mean_up, mean_up)
    up = np.linalg.eigh(level)[1][:, 0]
    up = up if up @ mean_up >= 0.0 else -up
    axis = int(np.argmax(np.abs(up)))
    return np.asarray(np.sign(up[axis]) * np.eye(3)[axis] if np.abs(up[axis]) > _NEARLY else up)
