"""Which way is up in a map, from the cameras that made it: images are seldom tilted sideways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats

# The horizontal axes of cameras say which way is up if they lie in a plane to this share of
# variance, and if their next direction has so many times that variance.
_MOST_VARIANCE, _LEAST_RATIO = 0.1, 4.0
# The tilt of new images: times that of the map's, at least so much [rad], and the share that has
# any tilt.
_WIDER, _LEAST_SIGMA, _ANY_TILT = 1.5, 0.1, 0.05


@dataclass(frozen=True, eq=False)
class Upright:
    """The direction up, and how far cameras are tilted sideways."""

    up: Floats
    """Unit vector in the world, shape (3,)."""
    sigma: float
    """Of the component of a camera's x axis along it."""

    def log_prior(self, rotation: Floats) -> Floats:
        """Return the log density of rotations (h, 3, 3), relative to that of any rotation."""
        tilt = self.up @ rotation[:, :, 0].T
        # Any tilt is as likely as any other on a sphere, with density 1/2, either side up.
        normal = np.exp(-0.5 * (tilt / self.sigma) ** 2) / (self.sigma * np.sqrt(2.0 * np.pi))
        is_up = self.up @ rotation[:, :, 1].T < 0.0
        return np.asarray(np.log(_ANY_TILT + (1.0 - _ANY_TILT) * 4.0 * normal * is_up))


def find_up(poses: Floats) -> Upright | None:
    """Find the direction up from poses world_from_camera (n, 7); None if they do not show it.

    A camera that never turns does not: any direction across its x axis may be up.
    """
    from scipy.spatial.transform import Rotation

    if len(poses) < 2:
        return None
    axes = Rotation.from_quat(poses[:, 3:]).as_matrix()
    variance, directions = np.linalg.eigh(np.einsum("ni,nj->ij", *[axes[:, :, 0]] * 2) / len(axes))
    if variance[0] > _MOST_VARIANCE or variance[1] < _LEAST_RATIO * max(variance[0], 1e-4):
        return None
    up = directions[:, 0] * -np.sign(np.sum(axes[:, :, 1] @ directions[:, 0]))
    return Upright(up, max(_WIDER * float(np.sqrt(max(variance[0], 0.0))), _LEAST_SIGMA))
