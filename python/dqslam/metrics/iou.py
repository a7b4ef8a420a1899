"""Intersection over union of boxes in the image, and of solids in space."""

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.solids import Solids, project_to_boxes


def box_iou(boxes: Floats, others: Floats) -> Floats:
    """Return the IoU of boxes [u_min, v_min, u_max, v_max], shape (..., 4), pairwise."""
    low = np.maximum(boxes[..., :2], others[..., :2])
    high = np.minimum(boxes[..., 2:], others[..., 2:])
    common = (high - low).clip(min=0.0)
    both = common[..., 0] * common[..., 1]
    sides = (b[..., 2:] - b[..., :2] for b in (boxes, others))
    area, other_area = (side[..., 0] * side[..., 1] for side in sides)
    return np.asarray(both / (area + other_area - both))


def match_boxes(
    pose: Ints, boxes: Floats, true_pose: Ints, true_boxes: Floats, *, min_iou: float = 0.5
) -> Ints:
    """Return the row of the true box that each box shows, -1 for none; shape (m,).

    The pairs of each pose are those with the largest sum of IoUs; a pair with an IoU below
    ``min_iou`` does not count. Poses are row numbers, shapes (m,) and (t,); boxes have shapes
    (m, 4) and (t, 4).
    """
    from scipy.optimize import linear_sum_assignment

    match = np.full(len(boxes), -1, dtype=np.int64)
    for one in np.unique(pose):
        rows, true_rows = np.flatnonzero(pose == one), np.flatnonzero(true_pose == one)
        overlap = box_iou(boxes[rows][:, None], true_boxes[true_rows][None])
        overlap[overlap < min_iou] = 0.0
        row, column = linear_sum_assignment(overlap, maximize=True)
        good = overlap[row, column] > 0.0
        match[rows[row[good]]] = true_rows[column[good]]
    return match


def reprojection_iou(
    camera: _core.Camera,
    world_from_camera: Floats,
    solids: Solids,
    boxes: Floats,
    truncated: Bools,
) -> Floats:
    """Return the IoU of each box with the projection of its solid, shape (m,).

    All arguments are row by row: poses (m, 7), m solids, boxes (m, 4) and flags of
    their truncated edges (m, 4). The camera must have no mount. Regions beyond a truncated edge are
    not compared, because they are outside the image. The IoU is 0 where the solid is not
    strictly in front of the camera.
    """
    predicted, visible = project_to_boxes(_core.PoseModel.SE3, camera, world_from_camera, solids)
    predicted = np.where(visible[:, None], predicted, boxes)
    low, high = predicted[:, :2], predicted[:, 2:]
    low = np.where(truncated[:, :2], np.maximum(low, boxes[:, :2]), low)
    high = np.where(truncated[:, 2:], np.minimum(high, boxes[:, 2:]), high)
    predicted = np.hstack([np.minimum(low, high), high])
    return np.where(visible, box_iou(predicted, boxes), 0.0)


def ellipsoid_iou(ellipsoid: Floats, other: Floats, *, samples: int = 4096, seed: int = 0) -> float:
    """Return the IoU of two ellipsoids, each center and log-Cholesky shape (9,); `solid_iou`."""
    one, two = (Solids.of_ellipsoids(each[None]) for each in (ellipsoid, other))
    return solid_iou(one, two, samples=samples, seed=seed)


def solid_iou(solid: Solids, other: Solids, *, samples: int = 4096, seed: int = 0) -> float:
    """Return the IoU of two solids, each the only one given, by sampling.

    The smaller one is filled with a scrambled Sobol sequence of ``samples`` points, a power of 2.
    With 4096 the error is about 0.002.
    """
    from scipy.stats import qmc

    (volume,), (other_volume,) = solid.volumes, other.volumes
    if volume > other_volume:
        return solid_iou(other, solid, samples=samples, seed=seed)
    points = solid.filled(0, qmc.Sobol(3, seed=seed).random(samples))
    both = volume * float(other.contains(0, points).mean())
    return float(both / (volume + other_volume - both))
