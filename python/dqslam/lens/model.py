"""Lens models: from the pinhole's normalized coordinates to those of the image as recorded.

Both are divided by the focal lengths: x / z and y / z of a point in the camera frame, and
(u - cx) / fx and (v - cy) / fy of its pixel. A model is up to three maps:

    q = p g(r) / r                with r = |p| and g(r) = r, the angle atan(r), or that of `fov`,
    d = q N(s) / D(s)             with s = |q|^2, the radial part,
      + (2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2,
         p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2)           with (x, y) = q.

A radial part turns back at some radius: beyond it, two directions share a pixel. There, and where
the whole map is folded, a lens has no value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from dqslam._checks import Floats

# Parameters by model, in the order of OpenCV, of ROS and of COLMAP's THIN_PRISM_FISHEYE.
PARAMETERS: dict[str, tuple[str, ...]] = {
    "plumb_bob": ("k1", "k2", "p1", "p2", "k3"),
    "rational": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "thin_prism": (*("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), *("s1", "s2", "s3", "s4")),
    "equidistant": ("k1", "k2", "k3", "k4"),
    "fov": ("omega",),
    "thin_prism_fisheye": ("k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
}
FISHEYES = ("equidistant", "thin_prism_fisheye")
# Steps of Newton's method: from the radial inverse, four or five reach the last digit.
_NEWTON_STEPS = 20
# Of the recorded coordinates, which are of order 1.
_TOLERANCE = 1e-13
# Points this near to the end of the range, as a share of it, are beyond it.
_EDGE = 1e-9
# The radial part is tabulated at so many radii; where it nowhere turns back, up to 89.4 degrees.
_TABLE = 4096
_FARTHEST = 100.0


@dataclass(frozen=True)
class Lens:
    """A lens model and its parameters, in the order of ``PARAMETERS``."""

    model: str
    parameters: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the name of the model, and the number and the range of the parameters."""
        if self.model not in PARAMETERS:
            raise ValueError(f"lens model {self.model!r} is none of {', '.join(PARAMETERS)}")
        names = self.names
        values = tuple(float(value) for value in self.parameters)
        object.__setattr__(self, "parameters", values)
        if len(values) != len(names):
            raise ValueError(
                f"lens model {self.model} has {len(names)} parameters, {' '.join(names)}, "
                f"got {len(values)}"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"lens model {self.model}: a parameter is not finite: {values}")
        if self.model == "fov" and not 0 < values[0] < np.pi:
            raise ValueError(f"lens model fov: omega is {values[0]:g}, not between 0 and pi")

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the parameters."""
        return PARAMETERS[self.model]

    @property
    def is_ideal(self) -> bool:
        """Return whether the lens bends nothing: that of a pinhole."""
        return self.model not in (*FISHEYES, "fov") and not any(self.parameters)

    def distort(self, ideal: ArrayLike) -> Floats:
        """Return recorded normalized coordinates (..., 2) of ideal ones, NaN beyond the range."""
        bent, _ = self.differentiate(ideal)
        return bent

    def differentiate(self, ideal: ArrayLike) -> tuple[Floats, Floats]:
        """Return recorded coordinates (..., 2) and their derivatives by the ideal ones (..., 2, 2).

        Both are NaN beyond the range.
        """
        ideal = np.asarray(ideal, dtype=np.float64)
        inner, by_ideal = self._inner(ideal)
        bent, by_inner = self._bend(inner)
        outside = ~self._in_range(inner, by_inner)
        bent[outside] = np.nan
        jacobian = by_inner if by_ideal is None else _product(by_inner, by_ideal)
        jacobian[outside] = np.nan
        return bent, jacobian

    def undistort(self, recorded: ArrayLike) -> Floats:
        """Return ideal normalized coordinates (..., 2) of recorded ones, NaN beyond the range."""
        recorded = np.asarray(recorded, dtype=np.float64)
        inner = self._radial_start(recorded)
        for _ in range(_NEWTON_STEPS):
            bent, jacobian = self._bend(inner)
            error = bent - recorded
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                if not np.any(np.abs(error) > _TOLERANCE):
                    break
                inner = inner - _solved(jacobian, error)
        with np.errstate(invalid="ignore", over="ignore"):
            bent, jacobian = self._bend(inner)
            found = np.all(np.abs(bent - recorded) <= 1e-10, axis=-1)
            found &= self._in_range(inner, jacobian)
        return self._outer(np.where(found[..., None], inner, np.nan))

    @cached_property
    def _by_name(self) -> dict[str, float]:
        return dict(zip(self.names, self.parameters, strict=True))

    def _coefficients(self, names: Sequence[str]) -> Floats:
        return np.array([self._by_name.get(name, 0.0) for name in names])

    @cached_property
    def _radial(self) -> tuple[np.polynomial.Polynomial, np.polynomial.Polynomial]:
        """Numerator and denominator, polynomials in the squared radius."""
        fisheye = self.model in FISHEYES
        above = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "k3")
        below = () if fisheye else ("k4", "k5", "k6")
        one = np.ones(1)
        return (
            np.polynomial.Polynomial(np.concatenate([one, self._coefficients(above)])),
            np.polynomial.Polynomial(np.concatenate([one, self._coefficients(below)])),
        )

    @cached_property
    def _limit(self) -> float:
        """The radius of q at which the radial part turns back or ends; infinite if nowhere."""
        above, below = self._radial
        s = np.polynomial.Polynomial([0.0, 1.0])
        # The numerator of d/dq of q N(q^2) / D(q^2), in s = q^2.
        slope = (above + 2 * s * above.deriv()) * below - 2 * s * above * below.deriv()
        roots = np.concatenate([slope.trim().roots(), below.trim().roots()])
        real = roots[(np.abs(roots.imag) < 1e-12 * (1 + np.abs(roots))) & (roots.real > 0)].real
        ends = np.sqrt(real).tolist()
        if self.model in FISHEYES:
            ends.append(np.pi / 2)
        if self.model == "fov":
            ends.append(np.pi / (2 * self.parameters[0]))
        return float(min(ends, default=np.inf))

    def _inner(self, ideal: Floats) -> tuple[Floats, Floats | None]:
        """Return q (..., 2), and its derivatives by the ideal coordinates (..., 2, 2).

        The derivatives are None where both are the same.
        """
        if self.model not in (*FISHEYES, "fov"):
            return ideal, None
        r = np.linalg.norm(ideal, axis=-1)
        if self.model == "fov":
            (omega,) = self.parameters
            slope = 2 * np.tan(omega / 2)
            g, by_r, at_zero = (
                np.arctan(r * slope) / omega,
                slope / omega / (1 + (r * slope) ** 2),
                slope / omega,
            )
        else:
            g, by_r, at_zero = np.arctan(r), 1 / (1 + r**2), 1.0
        near = r < 1e-9
        safe = np.where(near, 1.0, r)
        ratio = np.where(near, at_zero, g / safe)
        unit = ideal / safe[..., None]
        radial = np.where(near, 0.0, by_r - ratio)
        jacobian = ratio[..., None, None] * np.eye(2)
        jacobian = jacobian + radial[..., None, None] * unit[..., :, None] * unit[..., None, :]
        return ratio[..., None] * ideal, jacobian

    def _outer(self, inner: Floats) -> Floats:
        """Return the ideal coordinates (..., 2) of q."""
        if self.model not in (*FISHEYES, "fov"):
            return inner
        angle = np.linalg.norm(inner, axis=-1)
        omega, slope = 1.0, 1.0
        if self.model == "fov":
            (omega,) = self.parameters
            slope = 2 * np.tan(omega / 2)
        near = angle < 1e-9
        safe = np.where(near, 1.0, angle)
        ratio = np.where(near, omega / slope, np.tan(safe * omega) / slope / safe)
        return np.asarray(ratio[..., None] * inner)

    def _bend(self, inner: Floats) -> tuple[Floats, Floats]:
        """Return d (..., 2), and its derivatives by q (..., 2, 2)."""
        x, y = inner[..., 0], inner[..., 1]
        s = x * x + y * y
        ratio, by_s = self._ratio(s)
        p1, p2 = self._coefficients(("p1", "p2"))
        if self.model == "thin_prism_fisheye":
            s1, s3 = self._coefficients(("sx1", "sy1"))
            s2 = s4 = 0.0
        else:
            s1, s2, s3, s4 = self._coefficients(("s1", "s2", "s3", "s4"))
        u = x * ratio + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s * (s1 + s2 * s)
        v = y * ratio + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s * (s3 + s4 * s)
        along_u, along_v = 2 * (x * by_s + s1 + 2 * s2 * s), 2 * (y * by_s + s3 + 2 * s4 * s)
        cross = 2 * p1 * x + 2 * p2 * y
        jacobian = np.empty((*inner.shape, 2))
        jacobian[..., 0, 0] = ratio + along_u * x + 2 * p1 * y + 6 * p2 * x
        jacobian[..., 0, 1] = along_u * y + cross
        jacobian[..., 1, 0] = along_v * x + cross
        jacobian[..., 1, 1] = ratio + along_v * y + 6 * p1 * y + 2 * p2 * x
        return np.stack([u, v], axis=-1), jacobian

    def _ratio(self, s: Floats) -> tuple[Floats, Floats]:
        """Return N(s) / D(s), and its derivative."""
        above, below = (part.coef.astype(np.float64) for part in self._radial)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            value, slope = _horner(above, s)
            if not below[1:].any():
                return value, slope
            divisor, its_slope = _horner(below, s)
            ratio = value / divisor
            return ratio, (slope - ratio * its_slope) / divisor

    def _in_range(self, inner: Floats, jacobian: Floats) -> np.ndarray:
        """Tell where q (..., 2) is in front of the fold, by the derivatives of d by it."""
        with np.errstate(invalid="ignore", over="ignore"):
            radius = np.hypot(inner[..., 0], inner[..., 1])
            unfolded = _determinant(jacobian) > 0
            return np.asarray((radius < self._limit * (1 - _EDGE)) & unfolded)

    @cached_property
    def _radii(self) -> tuple[Floats, Floats]:
        """Radii of q up to the end of the range, and those of d, which grow with them."""
        end = min(self._limit * (1 - _EDGE), _FARTHEST)
        inner = np.tan(np.linspace(0.0, np.arctan(end), _TABLE))
        return inner, inner * self._ratio(inner**2)[0]

    def _radial_start(self, recorded: Floats) -> Floats:
        """Invert the radial part alone, by a table: q (..., 2)."""
        radius = np.hypot(recorded[..., 0], recorded[..., 1])
        inner, bent = self._radii
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.interp(radius, bent, inner) / radius
        return np.asarray(recorded * np.where(radius > 0, scale, 1.0)[..., None])


def _horner(coefficients: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Return a polynomial and its derivative; the constant comes first."""
    value, slope = np.full_like(s, coefficients[-1]), np.zeros_like(s)
    for coefficient in coefficients[-2::-1].tolist():
        slope = slope * s + value
        value = value * s + coefficient
    return value, slope


def _determinant(jacobian: Floats) -> Floats:
    return np.asarray(
        jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
    )


def _product(a: Floats, b: Floats) -> Floats:
    """Return products of 2 x 2 matrices; np.matmul is slow for such small ones."""
    return np.asarray(
        a[..., :, :1] * b[..., :1, :] + a[..., :, 1:] * b[..., 1:, :],
    )


def _solved(jacobian: Floats, error: Floats) -> Floats:
    """Return the solutions of 2 x 2 systems, NaN or infinite where there is none."""
    determinant = _determinant(jacobian)
    first = jacobian[..., 1, 1] * error[..., 0] - jacobian[..., 0, 1] * error[..., 1]
    second = jacobian[..., 0, 0] * error[..., 1] - jacobian[..., 1, 0] * error[..., 0]
    return np.stack([first, second], axis=-1) / determinant[..., None]
