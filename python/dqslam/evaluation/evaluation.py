"""The complete evaluation of a directory of results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from dqslam._checks import Floats
from dqslam.evaluation.boxes import evaluate_association, evaluate_reprojection
from dqslam.evaluation.errors import pose_nees
from dqslam.evaluation.objects import Match, evaluate_objects
from dqslam.evaluation.tracks import evaluate_tracks
from dqslam.evaluation.trajectory import common_poses, evaluate_trajectory
from dqslam.io import Results, Trajectory, TrueBoxes, TrueObjects, TrueTrack
from dqslam.metrics import Align, Alignment, align_poses, align_positions

# Orientations that differ by more than this, radians, belong to different things.
LARGEST_TURN = np.radians(20.0)


def evaluate_results(
    results: Results,
    groundtruth: Trajectory,
    *,
    align: Align = "se3",
    rpe_delta: float = 1.0,
    rpe_unit: Literal["frames", "meters"] = "frames",
    objects: TrueObjects | None = None,
    match: Match = "nearest",
    gate: float | None = None,
    boxes: TrueBoxes | None = None,
    tracks: Sequence[TrueTrack] | None = None,
    max_time_difference: float | None = None,
) -> dict[str, Any]:
    """Return the content of ``evaluation.json``; docs/evaluation.md has every key and unit.

    Parameters
    ----------
    groundtruth
        The true trajectory, in any world.
    align
        The kind of motion between both worlds that is removed. Trajectories are aligned by their
        positions, each by its own motion; objects by the whole poses of the estimate, see
        ``object_alignment``.
    rpe_delta, rpe_unit
        The distance for the relative pose error, see ``relative_pose_error``.
    objects, match, gate
        The true objects and how to match them, see ``evaluate_objects``.
    boxes
        Boxes of known objects, to evaluate the association.
    tracks
        The true tracks of what moves, see ``evaluate_tracks``.
    max_time_difference
        Times that differ by at most this, in seconds, count as the same; by default half the
        interval of poses.
    """
    from scipy.spatial.transform import Rotation

    rows, true_rows = common_poses(results.timestamps, groundtruth, max_time_difference)
    true_poses = groundtruth.world_from_camera[true_rows]

    def errors_of(poses: Floats) -> tuple[dict[str, Any], dict[str, Any]]:
        return evaluate_trajectory(
            poses[rows], true_poses, align=align, rpe_delta=rpe_delta, rpe_unit=rpe_unit
        )

    ate, rpe = errors_of(results.poses)
    odometry_ate, odometry_rpe = errors_of(results.initial_poses)
    alignment, by = object_alignment(results, results.poses[rows], true_poses, align)
    object_errors, association, track_errors = None, None, None
    if objects is not None:
        object_errors = evaluate_objects(
            results.objects, objects, alignment, match=match, gate=gate
        )
    if boxes is not None:
        association = evaluate_association(results, boxes, max_time_difference=max_time_difference)
    if tracks is not None:
        track_errors = evaluate_tracks(
            results, tracks, alignment, gate=gate, max_time_difference=max_time_difference
        )
    return {
        "align": align,
        "poses": len(rows),
        "ate": ate,
        "odometry_ate": odometry_ate,
        "rpe": rpe,
        "odometry_rpe": odometry_rpe,
        "nees": pose_nees(
            results, groundtruth, align=align, max_time_difference=max_time_difference
        ),
        "true_from_estimated": {
            "by": by,
            "rotation_xyzw": Rotation.from_matrix(alignment.rotation).as_quat(),
            "translation": alignment.translation,
            "scale": alignment.scale,
        },
        "objects": object_errors,
        "reprojection_iou": evaluate_reprojection(results),
        "association": association,
        "tracks": track_errors,
    }


def object_alignment(
    results: Results, poses: Floats, true_poses: Floats, align: Align
) -> tuple[Alignment, Literal["poses", "positions"]]:
    """Return the motion that brings the map into the world of the truth, and its source.

    It fits whole poses, (n, 7), with points as far ahead of them as objects are, which is the
    median of the objects' least distances from the path. Positions alone do not determine the
    rotation about a straight path. They are used if the poses do not agree, for example because the
    true poses are those of a body that looks in another direction than the camera.
    """
    from scipy.spatial.transform import Rotation

    path = results.poses[:, :3]
    nearest = [np.linalg.norm(path - center, axis=1).min() for center in results.objects.centers]
    lever = float(np.median(nearest)) if nearest else 0.0
    found = align_poses(poses, true_poses, align, lever=lever if lever > 0.0 else 1.0)
    turns, true_turns = (
        Rotation.from_quat(given[:, 3:]) for given in (found.apply_poses(poses), true_poses)
    )
    if align == "none" or np.median((true_turns.inv() * turns).magnitude()) < LARGEST_TURN:
        return found, "poses"
    return align_positions(poses[:, :3], true_poses[:, :3], align), "positions"
