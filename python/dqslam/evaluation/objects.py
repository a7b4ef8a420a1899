"""Objects of a map against the true ones."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam.io import MapObjects, TrueObjects
from dqslam.metrics import (
    Alignment,
    Matches,
    ellipsoid_iou,
    match_by_id,
    match_nearest,
    orientation_error,
    size_error,
)

Match = Literal["nearest", "id"]
# The largest distance of a match if sizes are unknown, meters.
GATE_WITHOUT_SIZES = 1.0


def evaluate_objects(
    objects: MapObjects,
    truth: TrueObjects,
    alignment: Alignment,
    *,
    match: Match = "nearest",
    gate: float | None = None,
) -> dict[str, Any]:
    """Match the objects of a map with the true ones, and compare each pair.

    A true object stands for the ellipsoid that is inscribed in its box, with semi-axes of half its
    sizes. Values that the truth does not have, or that no pair has, are None.

    Parameters
    ----------
    alignment
        true_from_estimated.
    match
        "nearest" matches within the gate, and within a class if truth and map have a class in
        common; "id" matches equal ids.
    gate
        The largest distance of a match from a true object, meters; by default its longest side,
        or ``GATE_WITHOUT_SIZES``.
    """
    centers = alignment.apply(objects.centers)
    class_names = _comparable_classes(objects, truth)
    free = np.ones(len(objects), dtype=np.bool_)
    standing = _match(objects, truth, centers, class_names, match, gate, free, truth.static)
    free[standing.row] = False
    moving = _match(objects, truth, centers, class_names, match, gate, free, ~truth.static)
    errors = np.linalg.norm(centers[standing.row] - truth.center[standing.true_row], axis=1)
    pairs = [
        {
            "id": int(objects.object_ids[row]),
            "true_id": None if truth.id is None else int(truth.id[true_row]),
            "class_name": objects.class_names[row],
            "center": float(error),
            **_compare_shapes(objects, row, truth, true_row, alignment),
        }
        for row, true_row, error in zip(standing.row, standing.true_row, errors, strict=True)
    ]
    matched = len(pairs)
    return {
        "match": match,
        "by_class": match == "nearest" and class_names is not None,
        "truth": int(truth.static.sum()),
        "matched": matched,
        "missed": int(truth.static.sum()) - matched,
        "invented": len(objects) - matched - len(moving.row),
        "moving": int((~truth.static).sum()),
        "moving_in_map": len(moving.row),
        **_summary("center", pairs, ("median", "mean", "max")),
        **_summary("size_relative", pairs, ("median", "mean", "max")),
        **_summary("volume_ratio", pairs, ("median",)),
        **_summary("orientation_deg", pairs, ("median", "mean", "max")),
        **_summary("iou_3d", pairs, ("median", "mean")),
        "pairs": pairs,
    }


def _comparable_classes(objects: MapObjects, truth: TrueObjects) -> tuple[str, ...] | None:
    """Return the classes of the truth, or None if no object of the map can have any of them."""
    if truth.class_name is None:
        return None
    have, true = (
        {name.strip().casefold() for name in names}
        for names in (objects.class_names, truth.class_name)
    )
    return truth.class_name if have & true else None


def _match(
    objects: MapObjects,
    truth: TrueObjects,
    centers: Floats,
    class_names: tuple[str, ...] | None,
    match: Match,
    gate: float | None,
    free: Bools,
    kind: Bools,
) -> Matches:
    """Match the free objects, flags (o,), with the true ones of a kind, flags (t,)."""
    mapped, rows = np.flatnonzero(free), np.flatnonzero(kind)
    if match == "id":
        if truth.id is None:
            raise ValueError(f"{truth.path}: there are no ids to match by")
        found = match_by_id(objects.object_ids[mapped], truth.id[rows])
    elif match == "nearest":
        gates = np.full(len(truth), GATE_WITHOUT_SIZES)
        if gate is not None:
            gates[:] = gate
        elif truth.size is not None:
            gates = truth.size.max(axis=1)
        names = [objects.class_names[row] for row in mapped]
        true_names = None if class_names is None else [class_names[row] for row in rows]
        found = match_nearest(centers[mapped], names, truth.center[rows], true_names, gates[rows])
    else:
        raise ValueError(f'match: expected "nearest" or "id", got {match!r}')
    return Matches(mapped[found.row], rows[found.true_row])


def _compare_shapes(
    objects: MapObjects, row: int, truth: TrueObjects, true_row: int, alignment: Alignment
) -> dict[str, float | None]:
    """Compare size, orientation and overlap of one object with the truth, as far as known."""
    from scipy.spatial.transform import Rotation

    names = ("size_relative", "volume_ratio", "orientation_deg", "iou_3d")
    unknown: dict[str, float | None] = dict.fromkeys(names)
    if truth.size is None or not objects.is_ellipsoid[row]:
        return unknown
    semi_axes = alignment.scale * objects.semi_axes[row]
    true_semi_axes = 0.5 * truth.size[true_row]
    sizes = unknown | {
        "size_relative": size_error(semi_axes, true_semi_axes),
        "volume_ratio": float(np.prod(semi_axes) / np.prod(true_semi_axes)),
    }
    if truth.rotation is None:
        return sizes
    world_from_object = Rotation.from_matrix(alignment.rotation) * Rotation.from_quat(
        objects.orientations[row]
    )
    true_rotation = truth.rotation[true_row]
    angle = orientation_error(
        world_from_object.as_matrix(), semi_axes, true_rotation, true_semi_axes
    )
    (center,) = alignment.apply(objects.centers[[row]])
    ellipsoid = _core.ellipsoid_from_axes(center, semi_axes, world_from_object.as_quat())
    true_ellipsoid = _core.ellipsoid_from_axes(
        truth.center[true_row], true_semi_axes, Rotation.from_matrix(true_rotation).as_quat()
    )
    return sizes | {
        "orientation_deg": None if np.isnan(angle) else angle,
        "iou_3d": ellipsoid_iou(ellipsoid, true_ellipsoid),
    }


def _summary(
    name: str, pairs: list[dict[str, Any]], wanted: tuple[str, ...]
) -> dict[str, float | None]:
    """Return e.g. ``center_median`` over the pairs that have a number, None without any."""
    values = [pair[name] for pair in pairs if pair[name] is not None]
    if not values:
        return {f"{name}_{which}": None for which in wanted}
    known = {"median": float(np.median(values)), "mean": float(np.mean(values)), "max": max(values)}
    return {f"{name}_{which}": known[which] for which in wanted}
