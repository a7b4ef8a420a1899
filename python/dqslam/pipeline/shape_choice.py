"""Which objects of a map are cuboids or cylinders, by boxes that took no part in the fit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam._core import Shape
from dqslam.association import CHI2_GATE
from dqslam.graph import Graph
from dqslam.solids import Rows, Solids, body_solids, box_chi_squares
from dqslam.subgraph import only_objects, rebuilt

# A shape is chosen for objects with at least so many boxes, half of which must predict the others.
FEWEST_BOXES = 10
# Boxes of an object that take part in that choice, evenly spread.
MOST_BOXES = 120
# Parts of an object's boxes, in the order of the path, that are fitted and predicted in turn.
BLOCKS = 6
# The log likelihood of boxes that took no part must be higher by this for an object. Seen from one
# side, things gain less, and their cuboids are turned and proportioned by chance.
LEAST_GAIN = 5.0
# Where this share of the objects of its class gain so much, an object may lose as much as that.
MOST_OF_CLASS, MOST_LOSS = 0.5, 1.0
# A shape that was told is given up where the boxes say so clearly.
GIVEN_UP = -10.0

_OTHER = {Shape.CUBOID: Shape.CYLINDER, Shape.CYLINDER: Shape.CUBOID}


@dataclass(frozen=True, eq=False)
class ShapeChoice:
    """Which objects are cuboids or cylinders, and what boxes that took no part say for it."""

    object_ids: Ints
    """Shape (o,)."""
    shapes: tuple[Shape, ...]
    """One per object."""
    gains: Floats
    """Log likelihood of boxes that took no part against the ellipsoid, shape (o,); NaN where it was
    not tested."""
    rejected: dict[int, str] = field(default_factory=dict)
    """Why objects whose own boxes fit another shape better are ellipsoids, by id."""
    given_up: dict[int, str] = field(default_factory=dict)
    """Why objects for which another shape was told are ellipsoids, by id."""

    @property
    def is_body(self) -> Bools:
        """Whether each object is a cuboid or a cylinder, shape (o,)."""
        return np.array([shape != Shape.ELLIPSOID for shape in self.shapes], dtype=np.bool_)


def choose_shapes(
    graph: Graph, state: _core.State, wanted: list[Shape], solver: _core.SolveOptions
) -> ShapeChoice:
    """Choose a shape for each object at the poses of a state, whose objects are ellipsoids.

    ``wanted`` has the shape of each object, or AUTO, and ``solver`` options in mode MAPPING. Every
    second part of an object's boxes predicts the parts between, as an ellipsoid and in the other
    shape.
    """
    rows = _evenly(graph.core.boxes.object, MOST_BOXES)
    core = _with_boxes(rebuilt(graph.core, initial_poses=state.poses, measurements=[]), rows)
    fitted = _core.solve(rebuilt(core, shapes=wanted), solver, state)
    shapes = list(fitted.shapes) or [Shape.ELLIPSOID] * len(wanted)
    counts = np.bincount(core.boxes.object, minlength=len(shapes))
    is_told = np.array([shape != Shape.AUTO for shape in wanted])
    is_body = np.array([shape != Shape.ELLIPSOID for shape in shapes])
    tested = np.flatnonzero(is_body & (counts >= FEWEST_BOXES))
    gains = np.full(len(shapes), np.nan)
    if tested.size:
        gains[tested] = _gains(core, state, shapes, tested, solver)
    # Boxes that took no part tell a cuboid from a cylinder better, where they are sure.
    free = tested[~is_told[tested]]
    if free.size:
        others = [_OTHER.get(shape, shape) for shape in shapes]
        of_others = _gains(core, state, others, free, solver)
        for row, gain in zip(free.tolist(), of_others.tolist(), strict=True):
            if gain > gains[row] + LEAST_GAIN:
                shapes[row], gains[row] = others[row], gain
    reasons: tuple[dict[int, str], dict[int, str]] = ({}, {})
    of_class: dict[tuple[str, Shape], list[float]] = defaultdict(list)
    for row in tested.tolist():
        of_class[graph.class_names[row], shapes[row]].append(gains[row])
    for row in np.flatnonzero(is_body).tolist():
        alike = np.array(of_class[graph.class_names[row], shapes[row]])
        is_usual = len(alike) > 1 and bool(np.mean(alike >= LEAST_GAIN) >= MOST_OF_CLASS)
        why = (
            _why_not_told(shapes[row], gains[row])
            if is_told[row]
            else _why_not_found(shapes[row], gains[row], is_usual, int(counts[row]))
        )
        if why is not None:
            reasons[int(is_told[row])][int(graph.object_ids[row])] = why
            shapes[row] = Shape.ELLIPSOID
    return ShapeChoice(graph.object_ids, tuple(shapes), gains, *reasons)


def _why_not_told(shape: Shape, gain: float) -> str | None:
    """Say why an object is an ellipsoid though another shape was told, which is rare."""
    if not gain < GIVEN_UP:  # or unknown
        return None
    return (
        f"an ellipsoid predicts its boxes far better than a {shape.name.lower()} "
        f"(log likelihoods differ by {gain:.2g})"
    )


def _why_not_found(shape: Shape, gain: float, is_usual: bool, boxes: int) -> str | None:
    """Say why an object is an ellipsoid though another shape fits its boxes better."""
    if np.isnan(gain):
        return f"{boxes} boxes are too few to tell that it is a {shape.name.lower()}"
    if gain >= LEAST_GAIN or (is_usual and gain >= -MOST_LOSS):
        return None
    return (
        f"a {shape.name.lower()} does not predict its boxes much better "
        f"(log likelihoods differ by {gain:.2g})"
    )


def describe_shapes(choice: ShapeChoice) -> dict[str, Any]:
    """Say which objects have another shape than an ellipsoid, and what speaks for it."""
    return {
        "shapes": {
            str(object_id): shape.name.lower()
            for object_id, shape in zip(choice.object_ids, choice.shapes, strict=True)
            if shape != Shape.ELLIPSOID
        },
        "log_likelihood_gain": {
            str(object_id): float(gain)
            for object_id, gain in zip(choice.object_ids, choice.gains, strict=True)
            if np.isfinite(gain)
        },
        "rejected": {str(object_id): why for object_id, why in choice.rejected.items()},
        "given_up": {str(object_id): why for object_id, why in choice.given_up.items()},
    }


def warn_of_shapes(shapes: Mapping[str, Any] | None) -> list[str]:
    """Name the objects that are ellipsoids though another shape was told."""
    given_up = {} if shapes is None else shapes["given_up"]
    return [f"object {name} is an ellipsoid: {why}" for name, why in given_up.items()]


def _gains(
    core: _core.Graph,
    state: _core.State,
    shapes: list[Shape],
    tested: Ints,
    solver: _core.SolveOptions,
) -> Floats:
    """Return by how much the log likelihood of boxes that took no part is higher in other shapes.

    It is that of the tested objects, shape (t,). A box that fits neither counts nothing.
    """
    kept = np.zeros(len(shapes), dtype=np.bool_)
    kept[tested] = True
    part = only_objects(rebuilt(core, shapes=[]), kept)
    ellipsoids = state.landmarks[kept]
    start = _core.State(state.poses, ellipsoids)
    own = [shapes[row] for row in tested]
    second = _second_half(part.boxes.object)
    gains = np.zeros(len(tested))
    for predicted in (second, ~second):
        fit = _with_boxes(part, np.flatnonzero(~predicted))
        test = _with_boxes(part, np.flatnonzero(predicted))
        plain = _core.solve(fit, solver, start)
        shaped = _core.solve(rebuilt(fit, shapes=own), solver, start)
        before = _chi_squares(test, state.poses, Solids.of_ellipsoids(plain.landmarks))
        after = _chi_squares(test, state.poses, _solids(shaped))
        np.add.at(gains, test.boxes.object, 0.5 * (before - after))
    return gains


def _solids(solution: _core.Solution) -> Solids:
    ellipsoids = np.array(
        [_core.ellipsoid_from_dual_quadric(one) for one in solution.dual_quadrics]
    )
    landmarks = solution.landmarks
    return body_solids(
        solution.shapes,
        ellipsoids,
        landmarks[:, :3],
        np.exp(landmarks[:, 3:6]),
        landmarks[:, 6:9],
    )


def _chi_squares(core: _core.Graph, poses: Floats, solids: Solids) -> Floats:
    """Return chi-squares (b,), none above that of a box that does not fit."""
    boxes = core.boxes
    chi2 = box_chi_squares(
        core.pose_model,
        core.camera,
        poses[boxes.pose],
        solids.take(boxes.object),
        boxes.box,
        boxes.covariance,
        boxes.truncated,
    )
    return np.asarray(np.minimum(chi2, CHI2_GATE[4]))


def _evenly(box_object: Rows, most: int) -> Ints:
    """Return rows of boxes (b,), at most so many of each object, evenly spread."""
    rows = []
    for one in np.unique(box_object):
        own = np.flatnonzero(box_object == one)
        rows.append(own[np.unique(np.linspace(0, len(own) - 1, most).round().astype(int))])
    return np.sort(np.concatenate(rows)) if rows else np.zeros(0, dtype=np.int64)


def _second_half(box_object: Rows) -> Bools:
    """Return which boxes are in every second part of the boxes of their object, shape (b,)."""
    second = np.zeros(len(box_object), dtype=np.bool_)
    for one in np.unique(box_object):
        own = np.flatnonzero(box_object == one)
        second[own] = (np.arange(len(own)) * BLOCKS // len(own)) % 2 == 1
    return second


def _with_boxes(core: _core.Graph, rows: Ints) -> _core.Graph:
    boxes = core.boxes
    part = _core.BoxTable(
        pose=boxes.pose[rows],
        object=boxes.object[rows],
        box=boxes.box[rows],
        covariance=boxes.covariance[rows],
        truncated=boxes.truncated[rows],
    )
    return rebuilt(core, boxes=part)
