"""Estimates with placements: planes and partners are found, and estimated, in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Ints, require
from dqslam._core import SolveOptions
from dqslam.assumptions import PlacementRules, check_placement_classes
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.placements.estimated_up import (
    mapped_part,
    state_of,
    up_of,
    with_uncertain_up,
    with_up,
)
from dqslam.placements.planes import FoundPlane
from dqslam.placements.table import FREE_HEIGHT_SIGMAS, Row, as_table, objects_of, place
from dqslam.placements.up import UpDirection
from dqslam.subgraph import rebuilt
from dqslam.uncertainty import Marginals, marginal_covariances

# Planes and partners are found anew with each estimate, until they stay or so often.
_ROUNDS = 3
# A placement that is off by more does not hold; its switch has taken most of its weight by then.
MOST_SIGMAS = 3.0


@dataclass(frozen=True)
class SupportPlane:
    """A horizontal plane that objects stand on."""

    height: float
    """Meters along the direction up."""
    sigma: float
    """Standard deviation of the height, meters, at the direction up that was told or estimated."""
    object_ids: Ints
    """The objects that stand on it."""


@dataclass(frozen=True)
class Placements:
    """What became of the rules of an estimate."""

    planes: tuple[SupportPlane, ...]
    kinds: tuple[str, ...]
    """"on", "beside", "aligned" or "upright", for each placement (p)."""
    object_ids: Ints
    """The object of each placement, shape (p,)."""
    other_ids: Ints
    """The object that it refers to, or -1, shape (p,)."""
    holds: Bools
    """Whether the estimate agrees with it within three sigmas, shape (p,)."""
    up: UpDirection | None = None
    """The direction up, where it was estimated."""


def solve_with_placements(
    graph: Graph,
    rules: PlacementRules,
    options: SolveOptions | None = None,
    *,
    start: _core.State | None = None,
) -> tuple[Graph, Estimate, _core.Summary, Placements]:
    """Estimate poses and objects with rules of where objects of a class are.

    The problem is first solved without the rules. In that estimate, each object of a rule gets
    the plane or the nearest object that the rule refers to, and the problem is solved again. The
    height of a plane is an unknown. A placement that does not fit costs 4.5 in half a chi-square at
    most, and hardly moves anything: the rules may be wrong for some objects.

    If the rules have ``up_sigma``, the direction up is estimated, too, from the lowest points of
    the objects that rules put on planes. The covariances of the result are then those of
    ``placed_covariances``.

    Parameters
    ----------
    graph
        The problem.
    rules
        Of ``load_placements``, or made of ``PlacementRule``.
    options, start
        As for ``solve``.

    Returns
    -------
    graph
        The problem with the placements, for ``placed_covariances``.
    estimate, summary
        As of ``solve``.
    placements
        The planes that were found, and which placements hold.

    Raises
    ------
    ValueError
        If a rule names a class that no object has.
    """
    require(graph, Graph, "solve_with_placements", "call build_graph(recording) first")
    require(rules, PlacementRules, "solve_with_placements", "load_placements(file) reads them")
    check_placement_classes(rules.rules, set(graph.class_names))
    if rules.up is not None:
        graph = with_up(graph, np.array(rules.up))
    options = SolveOptions() if options is None else options
    estimate, summary = solve(graph, options, start=start)
    up = None
    if rules.up_sigma is not None and len(estimate.object_ids):
        up = up_of(graph, estimate, rules.rules, rules.up_sigma, options)
        graph = with_up(graph, up.direction)
    placed, known = graph, len(graph.core.shared_sigma)
    rows: list[Row] = []
    planes: list[FoundPlane] = []
    for _ in range(_ROUNDS):
        marginals = marginal_covariances(placed, estimate, options)
        objects = objects_of(graph, estimate, marginals.objects)
        before = [_what(row) for row in rows]
        rows, planes = place(rules.rules, objects)
        if [_what(row) for row in rows] == before:
            break
        placed = _with_rows(graph, rows, planes, known)
        estimate, summary = solve(placed, options, start=start)
    found = _placements(placed, estimate, options, planes, known)
    return placed, estimate, summary, replace(found, up=up)


def placed_covariances(
    graph: Graph, estimate: Estimate, placements: Placements, options: SolveOptions | None = None
) -> Marginals:
    """Return the covariances of what ``solve_with_placements`` answers.

    They are those of ``marginal_covariances``, and larger by what the uncertainty of the direction
    up moves, if that was estimated.
    """
    options = SolveOptions() if options is None else options
    if placements.up is None:
        return marginal_covariances(graph, estimate, options)
    return with_uncertain_up(graph, estimate, placements.up, options)


def _what(row: Row) -> tuple[_core.Placement, int, int, int]:
    return (row.kind, row.object, row.other, row.plane)


def _with_rows(
    graph: Graph, rows: Sequence[Row], planes: Sequence[FoundPlane], known: int
) -> Graph:
    sigma = FREE_HEIGHT_SIGMAS * max((row.sigma for row in rows if row.plane >= 0), default=1.0)
    core = rebuilt(
        graph.core,
        shared_sigma=np.concatenate([graph.core.shared_sigma, np.full(len(planes), sigma)]),
        placements=as_table(rows, known),
    )
    return replace(graph, core=core)


def _placements(
    graph: Graph,
    estimate: Estimate,
    options: SolveOptions,
    planes: Sequence[FoundPlane],
    known: int,
) -> Placements:
    core = mapped_part(graph, estimate)
    sigmas = marginal_covariances(graph, estimate, options).shared
    table, ids = core.placements, estimate.object_ids
    holds = _core.placement_misfits(core, options, state_of(estimate)) <= MOST_SIGMAS

    def plane(number: int) -> SupportPlane:
        shared = known + number
        height = planes[number].height + float(estimate.shared[shared])
        on_it = ids[table.object[holds & (table.shared == shared)]]
        return SupportPlane(height, float(sigmas[shared]), on_it)

    return Placements(
        planes=tuple(plane(number) for number in range(len(planes))),
        kinds=tuple(kind.name.lower() for kind in table.kind),
        object_ids=ids[table.object],
        other_ids=np.where(table.other < 0, -1, ids[table.other]),
        holds=holds,
    )
