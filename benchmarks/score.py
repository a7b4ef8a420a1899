"""How good an answer is, whichever program gave it."""

import numpy as np

from benchmarks.problems import Problem
from benchmarks.results import Score
from dqslam import _core, align_rigid
from dqslam._checks import Floats
from dqslam._core import PoseModel


def score(problem: Problem, poses: Floats, dual_quadrics: Floats) -> Score:
    """Compare with the truth and with the measured boxes.

    Parameters
    ----------
    poses
        world_from_robot, shape (n, 3) in SE(2) or (n, 7) in SE(3).
    dual_quadrics
        q1 .. q9 of the objects with boxes, ids ascending, shape (o, 9).
    """
    truth, boxes = problem.truth, problem.recording.detections
    seen, object_row = np.unique(boxes.object_id, return_inverse=True)
    if len(poses) != len(truth.poses) or len(dual_quadrics) != len(seen):
        raise ValueError(
            f"answer: expected {len(truth.poses)} poses and {len(seen)} objects, "
            f"got {len(poses)} and {len(dual_quadrics)}"
        )
    position, true_position = poses[:, :2], truth.poses[:, :2]
    aligned = align_rigid(position, true_position).apply(position)
    ellipsoids = np.array([_ellipsoid_or_nan(row) for row in dual_quadrics])
    real = np.isfinite(ellipsoids).all(axis=1)[object_row]
    model = PoseModel.SE2 if poses.shape[1] == 3 else PoseModel.SE3
    predicted, in_front = _core.project_to_boxes(
        model, problem.recording.camera, poses[boxes.pose[real]], ellipsoids[object_row[real]]
    )
    error = (predicted - boxes.box[real])[in_front]
    centers = truth.centers[np.searchsorted(truth.object_ids, seen)]
    return Score(
        rmse_m=_root_mean_square(position - true_position),
        aligned_rmse_m=_root_mean_square(aligned - true_position),
        center_rmse_m=_root_mean_square(dual_quadrics[:, [3, 6, 8]] - centers),
        box_rms_px=float(np.sqrt(np.mean(error**2))) if len(error) else float("nan"),
        impossible_boxes=len(boxes) - len(error),
    )


def _root_mean_square(differences: Floats) -> float:
    """Of the lengths of rows."""
    return float(np.sqrt((differences**2).sum(axis=1).mean()))


def _ellipsoid_or_nan(dual_quadric: Floats) -> Floats:
    try:
        return _core.ellipsoid_from_dual_quadric(dual_quadric)
    except ValueError:
        return np.full(9, np.nan)
