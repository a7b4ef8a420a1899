"""Objects against true ones: their matches, and errors of place, size and orientation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.metrics.alignment import Alignment, same_shape

# Axes whose lengths differ by less than this factor do not determine an orientation.
NEAR_EQUAL = 1.2


@dataclass(frozen=True, eq=False)
class Matches:
    """Pairs of an object and a true object; each occurs at most once."""

    row: Ints
    """Rows of the objects, ascending, shape (k,)."""
    true_row: Ints
    """Rows of the true objects, shape (k,)."""


def match_by_id(ids: Ints, true_ids: Ints) -> Matches:
    """Match objects (o,) with the true ones (t,) of the same id."""
    _, row, true_row = np.intersect1d(ids, true_ids, return_indices=True)
    order = np.argsort(row)
    return Matches(row[order], true_row[order])


def match_nearest(
    centers: Floats,
    class_names: Sequence[str],
    true_centers: Floats,
    true_class_names: Sequence[str] | None,
    gates: Floats,
) -> Matches:
    """Match as many objects as possible, with the least total distance.

    Parameters
    ----------
    centers, true_centers
        Centers in the same world, meters, shapes (o, 3) and (t, 3).
    class_names, true_class_names
        Both objects of a pair have the same class, except for case and surrounding blanks; None
        if classes do not matter.
    gates
        The largest distance of a match from each true object, meters, shape (t,).
    """
    from scipy.optimize import linear_sum_assignment

    distance = np.linalg.norm(centers[:, None] - true_centers[None], axis=2)
    allowed = distance <= gates
    if true_class_names is not None:
        names, true_names = (
            np.array([name.strip().casefold() for name in given], dtype=np.str_)
            for given in (class_names, true_class_names)
        )
        allowed &= names[:, None] == true_names[None]
    # A pair that is not allowed costs more than all allowed pairs together.
    forbidden = 1.0 + float(distance[allowed].sum())
    row, true_row = linear_sum_assignment(np.where(allowed, distance, forbidden))
    good = allowed[row, true_row]
    return Matches(row[good], true_row[good])


def center_errors(centers: Floats, true_centers: Floats, alignment: Alignment) -> Floats:
    """Return the distance [m] of each object's center from the true one after an alignment.

    Both have shape (o, 3), the result has shape (o,). The alignment usually comes from the
    trajectory.
    """
    centers, true_centers = same_shape(centers, true_centers)
    return np.asarray(np.linalg.norm(alignment.apply(centers) - true_centers, axis=1))


def size_error(semi_axes: Floats, true_semi_axes: Floats) -> float:
    """Return the mean of |error| / truth over the three axes, each (3,), longest to shortest."""
    ratio: Floats = np.sort(semi_axes) / np.sort(true_semi_axes)
    return float(np.abs(ratio - 1.0).mean())


def orientation_error(
    rotation: Floats, semi_axes: Floats, true_rotation: Floats, true_semi_axes: Floats
) -> float:
    """Return the angle [deg] between the principal axes of two ellipsoids; NaN where free.

    Axes are paired by length. Of the 24 ways to name the axes of an ellipsoid, this leaves 4 that
    differ in signs; the error is the least of these. If the truth has two axes whose lengths differ
    by less than ``NEAR_EQUAL``, the rotation about the third axis is free and the error is the
    angle between the third axes. If all axes are as close as that, there is no orientation.

    Parameters
    ----------
    rotation, true_rotation
        world_from_object, columns are the axes, shape (3, 3).
    semi_axes, true_semi_axes
        Lengths of the axes, meters, shape (3,).
    """
    from scipy.spatial.transform import Rotation

    axes = rotation[:, np.argsort(semi_axes)]
    order = np.argsort(true_semi_axes)
    true_axes, lengths = true_rotation[:, order], true_semi_axes[order]
    low_equal = bool(lengths[1] < NEAR_EQUAL * lengths[0])
    high_equal = bool(lengths[2] < NEAR_EQUAL * lengths[1])
    if low_equal and high_equal:
        return float("nan")
    if low_equal or high_equal:
        distinct = 2 if low_equal else 0
        cosine = np.abs(axes[:, distinct] @ true_axes[:, distinct])
        return float(np.degrees(np.arccos(cosine.clip(max=1.0))))
    between = axes.T @ true_axes
    between[:, 0] *= np.sign(np.linalg.det(between))
    signs = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    angles = Rotation.from_matrix(between * signs[:, None, :]).magnitude()
    return float(np.degrees(angles.min()))
