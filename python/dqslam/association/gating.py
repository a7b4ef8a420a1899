"""Which object a box may show: predicted boxes, their covariance, and what each pairing costs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association.occlusion import hidden_edges

# 99 % of the boxes of an object that is where the map says lie below this, by edges that count.
CHI2_GATE = np.array([0.0, 6.63, 9.21, 11.34, 13.28])
# The gate of an association holds 99.9 %: a step of odometry that errs by two sigmas moves all
# boxes of an image at once, and a map that none of them is taken for is made again beside itself.
GATE = np.array([0.0, 10.83, 13.82, 16.27, 18.47])
# A box of which nearer objects may hide more edges shows too little to say what it is.
MAX_HIDDEN_EDGES = 1
# A detector confuses classes, so no class is impossible.
CONFUSED = 0.02
# Pairs of objects in images that are compared at a time: it bounds the memory.
MOST_PAIRS_AT_A_TIME = 500_000


@dataclass(frozen=True)
class PredictedBoxes:
    """Boxes of objects as seen from one pose: all shown in front of the camera."""

    object_row: NDArray[np.int64]
    """Rows of the objects that the image shows, shape (p,)."""
    box: NDArray[np.float64]
    """Pixels, shape (p, 4)."""
    covariance: NDArray[np.float64]
    """Of pose and object together, without the detector's noise, pixels^2, shape (p, 4, 4)."""
    out_of_sight: NDArray[np.bool_]
    """Edges that the object touches outside the image, shape (p, 4)."""
    hidden: NDArray[np.bool_]
    """Edges that a nearer object may hide, shape (p, 4)."""

    def without(self, objects: NDArray[np.bool_]) -> PredictedBoxes:
        """Leave out some objects: a flag for each that ``object_row`` may name."""
        kept = ~objects[self.object_row]
        return PredictedBoxes(
            self.object_row[kept],
            self.box[kept],
            self.covariance[kept],
            self.out_of_sight[kept],
            self.hidden[kept],
        )


def predict_boxes(
    camera: _core.Camera,
    pose_model: _core.PoseModel,
    pose: NDArray[np.float64],
    ellipsoids: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> PredictedBoxes:
    """Project objects (o, 9) into the image of a pose (d,).

    ``covariance`` is that of the pose's tangent and all ellipsoids, jointly: (k + 9 o, k + 9 o).
    No edge is flagged as hidden: where nearer objects are is not yet certain.
    """
    here = np.repeat(pose[None], len(ellipsoids), axis=0)
    box, in_front, jacobian = _core.differentiate_boxes(pose_model, camera, here, ellipsoids)
    row = np.flatnonzero(in_front & _overlaps_image(camera, box, margin=0.0))
    k = len(covariance) - 9 * len(ellipsoids)
    own = np.concatenate(
        [np.tile(np.arange(k), (len(row), 1)), k + 9 * row[:, None] + np.arange(9)], 1
    )
    joint = covariance[own[:, :, None], own[:, None, :]]
    # Of what nearly touches the camera, or may be anywhere in the image, nothing is predicted.
    size = float(np.hypot(camera.width, camera.height))
    with np.errstate(over="ignore", invalid="ignore"):
        spread = jacobian[row] @ joint @ jacobian[row].transpose(0, 2, 1)
        known = np.trace(spread, axis1=1, axis2=2) < size**2  # false where it is not a number
    row = row[known]
    out_of_sight = _core.edges_out_of_sight(pose_model, camera, here[row], ellipsoids[row])
    hidden = np.zeros((len(row), 4), dtype=np.bool_)
    return PredictedBoxes(row, box[row], spread[known], out_of_sight, hidden)


def predict_certain_boxes(
    camera: _core.Camera,
    pose_model: _core.PoseModel,
    poses: NDArray[np.float64],
    ellipsoids: NDArray[np.float64],
    *,
    sees_hidden: bool = False,
) -> Iterator[PredictedBoxes]:
    """Project objects (o, 9) into the images of poses (n, d), all of which are certain.

    The boxes are those of ``predict_boxes`` for a covariance of zeros, image by image. Many images
    are projected at a time, which is faster. With ``sees_hidden``, edges are flagged that a nearer
    object in the image may hide.
    """
    o = len(ellipsoids)
    images = max(1, MOST_PAIRS_AT_A_TIME // max(o * o, 1))
    for begin in range(0, len(poses), images):
        part = poses[begin : begin + images]
        here, objects = np.repeat(part, o, axis=0), np.tile(ellipsoids, (len(part), 1))
        box, in_front, jacobian = _core.differentiate_boxes(pose_model, camera, here, objects)
        # What nearly touches the camera has derivatives that overflow: nothing is predicted of it.
        known = np.isfinite(jacobian).all(axis=(1, 2))
        shown = in_front & _overlaps_image(camera, box, margin=0.0) & known
        out_of_sight = np.zeros((len(box), 4), dtype=np.bool_)
        out_of_sight[shown] = _core.edges_out_of_sight(
            pose_model, camera, here[shown], objects[shown]
        )
        table = shown.reshape(len(part), o)
        hidden = np.zeros((len(part), o, 4), dtype=np.bool_)
        if sees_hidden:
            hidden = hidden_edges(camera, pose_model, part, ellipsoids, table)
        for image, flags in enumerate(table):
            row = np.flatnonzero(flags)
            own = image * o + row
            spread = np.zeros((len(row), 4, 4))
            yield PredictedBoxes(row, box[own], spread, out_of_sight[own], hidden[image, row])


def in_image(
    camera: _core.Camera,
    pose_model: _core.PoseModel,
    pose: NDArray[np.float64],
    ellipsoids: NDArray[np.float64],
    *,
    margin: float = 0.0,
) -> NDArray[np.bool_]:
    """Tell which objects (o, 9) the image of a pose (d,) shows, wholly or in part.

    ``margin`` is added to the image on all sides, as a part of its size.
    """
    here = np.repeat(pose[None], len(ellipsoids), axis=0)
    box, in_front = _core.project_to_boxes(pose_model, camera, here, ellipsoids)
    return np.asarray(in_front & _overlaps_image(camera, box, margin=margin))


def _overlaps_image(
    camera: _core.Camera, box: NDArray[np.float64], *, margin: float
) -> NDArray[np.bool_]:
    size = np.array([camera.width, camera.height])
    first, last = -0.5 - margin * size, (1.0 + margin) * size - 0.5
    overlap = np.minimum(box[:, 2:], last) - np.maximum(box[:, :2], first)
    return np.asarray(np.all(overlap > 0, axis=1))


@dataclass(frozen=True)
class PairCosts:
    """What it costs to say that a box shows an object, and that it shows something else."""

    cost: NDArray[np.float64]
    """-2 ln of the likelihood, infinite outside of the gate, shape (b, p)."""
    null: NDArray[np.float64]
    """The same of a box that shows something else, shape (b,)."""


def pair_costs(
    camera: _core.Camera,
    predicted: PredictedBoxes,
    box: NDArray[np.float64],
    box_covariance: NDArray[np.float64],
    truncated: NDArray[np.bool_],
    class_probability: NDArray[np.float64],
) -> PairCosts:
    """Compare boxes (b, 4) with predicted ones: ``d^2 + ln |2 pi S| - 2 ln p(class)``.

    Edges that the image border cut take no part. On a box with such an edge, nor do those that the
    object touches outside the image, unless it ends inside. One edge that may be hidden
    is not compared where the box ends before it. ``class_probability`` (b, p) is that of
    the box's class given the object. A box of something else may lie anywhere in the image and have
    any size up to half of it.
    """
    error = box[:, None] - predicted.box
    reaches = error * [-1.0, -1.0, 1.0, 1.0] < 0.0
    is_cut = np.asarray(truncated.any(axis=1))[:, None, None]
    behind = predicted.hidden & reaches
    behind &= behind.sum(axis=2, keepdims=True) <= MAX_HIDDEN_EDGES
    ignored = truncated[:, None, :] | (is_cut & predicted.out_of_sight & reaches) | behind
    error = np.where(ignored, 0.0, error)
    # An edge that is ignored: no error, and a variance that the determinant does not see.
    spread = predicted.covariance + box_covariance[:, None]
    spread = np.where(ignored[..., :, None] | ignored[..., None, :], 0.0, spread)
    spread = spread + (ignored / (2 * np.pi))[..., None] * np.eye(4)
    d2 = np.sum(error * np.linalg.solve(spread, error[..., None])[..., 0], axis=-1)
    log_det = np.linalg.slogdet(2 * np.pi * spread)[1]
    edges = 4 - ignored.sum(axis=2)
    inside = (d2 <= GATE[edges]) & (edges > 0)
    # What an object says nothing of is anywhere, as if the box showed something else.
    anywhere = 2 * np.log((camera.width * camera.height) ** 2 / 4.0) / 4.0
    null = anywhere * (4 - truncated.sum(axis=1))
    cost = d2 + log_det - 2 * np.log(class_probability) + null[:, None] - anywhere * edges
    return PairCosts(cost=np.where(inside, cost, np.inf), null=null)
