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
    match_by_id,
    match_nearest,
    orientation_error,
    size_error,
    solid_iou,
)
from dqslam.solids import Solids

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

    A true object stands for the solid of the same shape as the estimated one that is inscribed in
    its box, with half-lengths of half its sizes. Values that the truth does not have, or that no
    pair has, are None.

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
    names = ("size_relative", "volume_ratio", "orientation_deg", "iou_3d")
    unknown: dict[str, float | None] = dict.fromkeys(names)
    if truth.size is None or not objects.is_ellipsoid[row]:
        return unknown
    solid = objects.solids.take([row]).moved(
        alignment.rotation, alignment.translation, alignment.scale
    )
    half_lengths = np.linalg.norm(solid.factors[0], axis=0)
    true_half_lengths = 0.5 * truth.size[true_row]
    sizes = unknown | {
        "size_relative": size_error(half_lengths, true_half_lengths),
        "volume_ratio": float(np.prod(half_lengths) / np.prod(true_half_lengths)),
    }
    if truth.rotation is None:
        return sizes
    true_rotation = truth.rotation[true_row]
    angle = orientation_error(
        solid.factors[0] / half_lengths, half_lengths, true_rotation, true_half_lengths
    )
    order = np.arange(3)
    if solid.shapes[0] == _core.Shape.CYLINDER:  # its axis, the third, is that nearest to it
        along = np.argmax(np.abs(true_rotation.T @ solid.factors[0, :, 2]))
        order = np.roll(order, 2 - along)
    inscribed = Solids.of_axes(
        solid.shapes,
        truth.center[[true_row]],
        true_half_lengths[None, order],
        true_rotation[None][:, :, order],
    )
    return sizes | {
        "orientation_deg": None if np.isnan(angle) else angle,
        "iou_3d": solid_iou(solid, inscribed),
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
