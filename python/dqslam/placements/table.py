"""Rules of placement as rows of a problem: which object they hold for, and on which other one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.assumptions import GROUND, PLANE, PlacementRule
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.placements.lowest_points import gradients_by_objects, height_sigmas, tangents
from dqslam.placements.planes import FoundPlane, find_planes

# The height of a plane is free: the prior on how far it is from where it was found.
FREE_HEIGHT_SIGMAS = 1e3


@dataclass(frozen=True)
class Row:
    """A row of the table of placements."""

    kind: _core.Placement
    object: int
    other: int = -1
    plane: int = -1
    distance: float = 0.0
    sigma: float = 1.0


@dataclass(frozen=True)
class Objects:
    """The mapped objects of a problem, as placements see them; all with shape (n, ...)."""

    rows: Ints
    """Their rows in the problem."""
    class_names: tuple[str, ...]
    centers: Floats
    """Meters, (n, 3), where the third axis is up."""
    reach: Floats
    """How far they extend horizontally, and along up, from the center, meters, (n, 2)."""
    height_sigmas: Floats
    """Uncertainty of the lowest point, meters."""

    @property
    def bottoms(self) -> Floats:
        """Heights of the lowest points, meters."""
        return self.centers[:, 2] - self.reach[:, 1]

    @property
    def tops(self) -> Floats:
        """Heights of the highest points, meters."""
        return self.centers[:, 2] + self.reach[:, 1]


def objects_of(graph: Graph, estimate: Estimate, covariances: Floats) -> Objects:
    """Return the objects of an estimate, of covariances (o, 9, 9), with the third axis up."""
    up = graph.core.scene_priors.up
    axes = np.vstack([tangents(up), up])
    solids = estimate.solids
    reach = np.stack([solids.support(axis) for axis in axes], axis=1)
    return Objects(
        rows=np.flatnonzero(np.isin(graph.object_ids, estimate.object_ids)),
        class_names=estimate.class_names,
        centers=estimate.centers @ axes.T,
        reach=np.column_stack([reach[:, :2].max(axis=1), reach[:, 2]]),
        height_sigmas=height_sigmas(gradients_by_objects(estimate, up), covariances),
    )


def place(rules: Sequence[PlacementRule], objects: Objects) -> tuple[list[Row], list[FoundPlane]]:
    """Return a row for each object of each rule that finds what it refers to, and the planes."""
    rows: list[Row] = []
    planes: list[FoundPlane] = []
    for rule in rules:
        chosen = _of_class(objects, rule.class_name)
        if rule.kind == "upright":
            rows += [
                Row(_core.Placement.UPRIGHT, int(objects.rows[i]), sigma=rule.sigma) for i in chosen
            ]
        elif rule.other in (PLANE, GROUND):
            rows += _on_planes(rule, objects, chosen, planes)
        else:
            rows += _to_others(rule, objects, chosen)
    return rows, planes


def as_table(rows: Sequence[Row], first_shared: int) -> _core.PlacementTable:
    """Return the rows as a table; the planes are shared numbers from `first_shared` on."""
    return _core.PlacementTable(
        kind=[row.kind for row in rows],
        object=np.array([row.object for row in rows], dtype=np.int64),
        other=np.array([row.other for row in rows], dtype=np.int64),
        shared=np.array(
            [-1 if row.plane < 0 else first_shared + row.plane for row in rows], dtype=np.int64
        ),
        distance=np.array([row.distance for row in rows], dtype=np.float64),
        sigma=np.array([row.sigma for row in rows], dtype=np.float64),
    )


def _of_class(objects: Objects, name: str | None) -> Ints:
    if name is None:
        return np.arange(len(objects.rows))
    return np.flatnonzero(np.array(objects.class_names, dtype=object) == name)


def _on_planes(
    rule: PlacementRule, objects: Objects, chosen: Ints, planes: list[FoundPlane]
) -> list[Row]:
    """Find the planes of the chosen objects, append them, and return the rows of these objects."""
    sigmas = np.hypot(rule.sigma, objects.height_sigmas[chosen])
    heights = objects.bottoms[chosen]
    found = find_planes(heights, sigmas, rule.other == PLANE)
    if not found:
        return []
    first = len(planes)
    planes += [FoundPlane(plane.height, objects.rows[chosen[plane.rows]]) for plane in found]
    off = np.abs(heights[:, None] - [plane.height for plane in found]) / sigmas[:, None]
    return [
        Row(
            _core.Placement.ON,
            int(objects.rows[i]),
            plane=first + int(nearest),
            distance=found[nearest].height,
            sigma=rule.sigma,
        )
        for i, nearest in zip(chosen, np.nanargmin(off, axis=1), strict=True)
    ]


def _to_others(rule: PlacementRule, objects: Objects, chosen: Ints) -> list[Row]:
    kinds = {
        "on": _core.Placement.ON,
        "beside": _core.Placement.BESIDE,
        "aligned": _core.Placement.ALIGNED,
    }
    others = _of_class(objects, rule.other)
    rows = []
    for i in chosen:
        rest = others[others != i]
        if len(rest) == 0:
            continue
        between = objects.centers[rest] - objects.centers[i]
        away = np.linalg.norm(between[:, :2], axis=1)
        if rule.kind == "on":  # the one that it is least beside, above or within
            gap = np.abs(objects.bottoms[i] - objects.tops[rest])
            away = np.hypot(np.maximum(away - objects.reach[rest, 0], 0.0), gap)
        nearest = int(np.argmin(away))
        rows.append(
            Row(
                kinds[rule.kind],
                int(objects.rows[i]),
                other=int(objects.rows[rest[nearest]]),
                distance=rule.distance,
                sigma=rule.sigma,
            )
        )
    return rows
