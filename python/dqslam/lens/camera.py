"""A pinhole camera behind any lens model."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, as_floats, reject_rows
from dqslam.lens.model import Lens


class LensCamera(_core.Camera):
    """A pinhole camera with a lens that is not OpenCV's of five numbers. Immutable.

    The estimator sees its pinhole: boxes and points are undistorted on the way in.
    """

    def __init__(
        self,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        width: int,
        height: int,
        *,
        lens: Lens,
        robot_from_camera: ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    ) -> None:
        """Focal lengths, principal point and size in pixels; the lens; the SE(3) mount."""
        mount = np.asarray(robot_from_camera, dtype=np.float64)
        super().__init__(fx, fy, cx, cy, width, height, robot_from_camera=mount)
        self._lens = lens

    @property
    def lens(self) -> Lens:
        """The lens model and its parameters."""
        return self._lens

    @property
    def has_distortion(self) -> bool:
        """Whether recorded pixels differ from those of the pinhole."""
        return not self._lens.is_ideal

    @property
    def distortion(self) -> Floats:
        """Parameters of the lens, in the order of its model."""
        return np.array(self._lens.parameters)

    def undistort_points(self, distorted: ArrayLike) -> Floats:
        """Ideal pinhole pixels of distorted pixels, shape (n, 2).

        Raises
        ------
        ValueError
            If a point lies beyond the range of the lens, with its row.
        """
        given = as_floats("points", distorted, [None, 2])
        points = ideal_pixels(self, given)
        reject_rows("points", np.isnan(points), "beyond the range of the lens", given)
        return points

    def distort_points(self, undistorted: ArrayLike) -> Floats:
        """Distorted pixels of ideal pinhole pixels, shape (n, 2).

        Raises
        ------
        ValueError
            If a point lies beyond the range of the lens, with its row.
        """
        given = as_floats("points", undistorted, [None, 2])
        points = recorded_pixels(self, given)
        reject_rows("points", np.isnan(points), "beyond the range of the lens", given)
        return points

    def undistort_boxes(self, distorted: ArrayLike) -> Floats:
        """Undistorted boxes, shape (n, 4), as ``lens.undistort_boxes`` makes them."""
        from dqslam.lens.boxes import undistort_boxes

        return undistort_boxes(self, distorted)

    def distort_boxes(self, undistorted: ArrayLike) -> Floats:
        """Boxes as recorded, shape (n, 4): inverts ``undistort_boxes``."""
        from dqslam.lens.boxes import distort_boxes

        return distort_boxes(self, undistorted)

    def __repr__(self) -> str:
        """Show size, focal lengths, principal point and lens model."""
        return (
            f"LensCamera({self.width} x {self.height} px, fx={self.fx:g}, fy={self.fy:g}, "
            f"cx={self.cx:g}, cy={self.cy:g}, {self._lens.model})"
        )


def camera_with(
    camera: _core.Camera,
    lens: Lens,
    *,
    robot_from_camera: ArrayLike | None = None,
) -> _core.Camera:
    """Return the pinhole of a camera behind a lens; the core knows that of five numbers itself."""
    mount = camera.robot_from_camera if robot_from_camera is None else robot_from_camera
    mount = np.asarray(mount, dtype=np.float64)
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    if lens.model == "plumb_bob":
        parameters = np.array(lens.parameters)
        return _core.Camera(*numbers, distortion=parameters, robot_from_camera=mount)
    return LensCamera(*numbers, lens=lens, robot_from_camera=mount)


def lens_of(camera: _core.Camera) -> Lens:
    """Return the lens of a camera, of whichever model."""
    if isinstance(camera, LensCamera):
        return camera.lens
    return _plumb_bob(*camera.distortion.tolist())


@lru_cache(maxsize=64)
def _plumb_bob(*parameters: float) -> Lens:
    """Return the same lens for the same numbers: it keeps what it has worked out of them."""
    return Lens("plumb_bob", parameters)


def recorded_pixels(camera: _core.Camera, ideal: ArrayLike) -> Floats:
    """Return the pixels (..., 2) as recorded of those of the pinhole; NaN beyond the lens."""
    points = np.asarray(ideal, dtype=np.float64)
    return lens_of(camera).distort((points - _middle(camera)) / _focal(camera)) * _focal(
        camera
    ) + _middle(camera)


def ideal_pixels(camera: _core.Camera, recorded: ArrayLike) -> Floats:
    """Return the pixels (..., 2) of the pinhole of those as recorded; NaN beyond the lens."""
    points = np.asarray(recorded, dtype=np.float64)
    return lens_of(camera).undistort((points - _middle(camera)) / _focal(camera)) * _focal(
        camera
    ) + _middle(camera)


def differentiate_pixels(camera: _core.Camera, ideal: ArrayLike) -> tuple[Floats, Floats]:
    """Return recorded pixels (..., 2), and their derivatives (..., 2, 2) by those of the pinhole.

    Both are NaN beyond the range of the lens.
    """
    focal, middle = _focal(camera), _middle(camera)
    points, jacobian = lens_of(camera).differentiate((np.asarray(ideal) - middle) / focal)
    return points * focal + middle, jacobian * (focal[:, None] / focal)


def _focal(camera: _core.Camera) -> Floats:
    return np.array([camera.fx, camera.fy])


def _middle(camera: _core.Camera) -> Floats:
    return np.array([camera.cx, camera.cy])
