"""The assumed noise of measurements: the edges of boxes and the steps of odometry."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam._core import Camera, PoseModel
from dqslam.lens import edge_scales

# Sigmas of odometry outside of this range mean exact or useless odometry, and their squares are
# badly conditioned.
SIGMAS = (1e-9, 1e6)


@dataclass(frozen=True)
class BoxNoise:
    """The distance of a box edge from the outline of an ellipsoid.

    sigma = hypot(pixels, relative * side of the box across that edge). The first part is the
    detector's noise. The second part grows with the box, because real objects are not ellipsoids.
    """

    pixels: float = 2.0
    """Constant part of sigma, pixels of the image as recorded."""
    relative: float = 0.05
    """Part of sigma that is proportional to the side of the box, as a share of the side."""

    def covariance(self, box: Floats, camera: Camera | None = None) -> Floats:
        """Return the covariance [px^2] of u_min, v_min, u_max, v_max, shape (b, 4, 4).

        The boxes are those of the pinhole of ``camera``. Its lens enlarges the detector's pixels
        there; without a camera it does not.
        """
        if not (np.isfinite([self.pixels, self.relative]).all() and self.pixels > 0.0):
            raise ValueError(f"box noise: expected positive, finite pixels, got {self}")
        if self.relative < 0.0:
            raise ValueError(f"box noise: relative is negative: {self}")
        side = np.tile(box[:, 2:] - box[:, :2], (1, 2))
        scale = 1.0 if camera is None else edge_scales(camera, box)
        variance = (self.pixels * scale) ** 2 + (self.relative * side) ** 2
        return np.asarray(variance[:, :, None] * np.eye(4))


@dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations of one step of odometry on each axis, in meters and radians."""

    translation_m: float = 0.01
    rotation_rad: float = 0.005

    def __post_init__(self) -> None:
        """Refuse values that are not standard deviations."""
        for name, sigma in (("translation", self.translation_m), ("rotation", self.rotation_rad)):
            if not SIGMAS[0] <= sigma <= SIGMAS[1]:
                raise ValueError(
                    f"odometry noise: {name} is {sigma:g}, not between "
                    f"{SIGMAS[0]:g} and {SIGMAS[1]:g}"
                )

    def covariance(self, steps: int, pose_model: PoseModel = PoseModel.SE3) -> Floats:
        """Repeat the covariance of a step, translation first: shape (steps, k, k)."""
        axes = (2, 1) if pose_model == PoseModel.SE2 else (3, 3)
        variance = np.repeat([self.translation_m**2, self.rotation_rad**2], axes)
        return np.tile(np.diag(variance), (steps, 1, 1))
