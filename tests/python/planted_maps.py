"""Two maps of which it is known how they lie to each other."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dqslam.places import Landmarks

Floats = NDArray[np.float64]


def landmarks(
    centers: Floats,
    classes: list[str] | None = None,
    *,
    covariances: Floats | None = None,
    semi_axes: Floats | None = None,
    shares_errors: bool = False,
) -> Landmarks:
    """Return a map with ids that are no rows."""
    count = len(centers)
    unknown = np.full((count, 3), np.nan)
    return Landmarks(
        name="planted",
        object_ids=100 + np.arange(count),
        class_names=tuple(classes or ["car"] * count),
        centers=np.array(centers, dtype=float),
        covariances=np.full((count, 3, 3), np.nan) if covariances is None else covariances,
        semi_axes=unknown if semi_axes is None else semi_axes,
        log_semi_axes_sigmas=unknown,
        orientations=np.full((count, 4), np.nan),
        observations=np.ones(count, dtype=np.int64),
        shares_errors=shares_errors,
    )


def motion(yaw: float, translation: tuple[float, float, float], scale: float = 1.0) -> Floats:
    """Return a turn about z, a scale and a translation, (4, 4)."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:3, :3] *= scale
    matrix[:3, 3] = translation
    return matrix


def moved(matrix: Floats, points: Floats) -> Floats:
    """Return points (n, 3) moved by (4, 4)."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def strewn(random: np.random.Generator, count: int, side: float = 30.0) -> Floats:
    """Return places on a square, at heights of some decimeters."""
    ground = random.uniform(0.0, side, (count, 2))
    return np.column_stack([ground, random.normal(0.0, 0.3, count)])


def two_maps(
    seed: int, *, shared: int, others: int, sigma: float, b_from_a: Floats, side: float = 30.0
) -> tuple[Floats, Floats]:
    """Return centers of two maps, whose first objects are the same, in another order in B."""
    random = np.random.default_rng(seed)
    world = strewn(random, shared + 2 * others, side)
    a, b = world[: shared + others], np.delete(world, np.s_[shared : shared + others], axis=0)
    a = a + random.normal(0.0, sigma, a.shape)
    b = moved(b_from_a, b) + random.normal(0.0, sigma, b.shape)
    return a, b[::-1]


def write_csv(path: Path, centers: Floats, classes: list[str] | None = None) -> Path:
    """Write ``class_id,x,y,z``."""
    names = classes or ["1"] * len(centers)
    rows = [
        f"{name},{x!r},{y!r},{z!r}" for name, (x, y, z) in zip(names, centers.tolist(), strict=True)
    ]
    path.write_text("\n".join(["class_id,x,y,z", *rows]) + "\n")
    return path
