"""How large and how oblong objects are."""

import numpy as np
from numpy.random import Generator

from dqslam._checks import Floats
from dqslam.simulation.scenario import LogNormalSizeSettings, ObjectKind, ProportionSettings

_UP = [0.0, 0.0, 1.0]


def log_normal(size: LogNormalSizeSettings, count: int, random: Generator) -> tuple[Floats, Floats]:
    """Draw ellipsoids from a size prior: semi-axes (o, 3) and orientations (o, 4)."""
    from scipy.spatial.transform import Rotation

    normal = random.normal(size=(count, 3, 3))
    # Symmetric, with variance 1 on the diagonal and 1/2 off it, so that it is isotropic.
    logarithm, axes = np.linalg.eigh((normal + normal.transpose(0, 2, 1)) / 2.0)
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]  # right-handed
    semi_axes = size.median_m * size.spread**logarithm
    return np.asarray(semi_axes), Rotation.from_matrix(axes).as_quat()


def proportioned(
    shape: ProportionSettings, count: int, random: Generator
) -> tuple[Floats, Floats | None]:
    """Draw semi-axes (o, 3) of equal ratios, and orientations (o, 4), or None for upright ones."""
    ratio = np.array(shape.ratio)
    size = shape.median_m * shape.spread ** random.normal(size=count)
    semi_axes = size[:, None] * ratio / np.cbrt(ratio.prod())
    if shape.orientation == "upright":
        return semi_axes, None
    turn = random.normal(size=(count, 4))  # all rotations are equally likely
    return semi_axes, turn / np.linalg.norm(turn, axis=1, keepdims=True)


def half_height(objects: ObjectKind, semi_axes: Floats, orientation: Floats) -> Floats:
    """Return the height of the top of ellipsoids or cuboids above their centers, m, (o,)."""
    from scipy.spatial.transform import Rotation

    up_in_object = Rotation.from_quat(orientation).inv().apply(_UP)
    if objects == "cuboids":
        return np.asarray(np.abs(semi_axes * up_in_object).sum(axis=1))
    return np.asarray(np.linalg.norm(semi_axes * up_in_object, axis=1))
