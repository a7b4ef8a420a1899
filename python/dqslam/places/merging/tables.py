"""The tables of two problems, one after the other, in the frame of the first."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.subgraph import rebuilt

# The second path begins anywhere [m, rad], as far as odometry says.
_LOOSE = 1e3


def joined_tables(
    a: _core.Graph, b: _core.Graph, poses: Floats, initial: Floats, row_of_b: Ints, new: Bools
) -> _core.Graph:
    """Return the tables of both, one after the other."""
    before = a.num_poses
    k = round(a.odometry.covariance.shape[1] ** 0.5)
    step = _core.between(a.pose_model, poses[before - 1 : before], poses[before : before + 1])
    loose = np.diag(np.full(k, _LOOSE**2)).reshape(1, -1)
    odometry = _core.OdometryTable(
        from_pose=np.concatenate(
            [a.odometry.from_pose, [before - 1], b.odometry.from_pose + before]
        ),
        to_pose=np.concatenate([a.odometry.to_pose, [before], b.odometry.to_pose + before]),
        relative=np.concatenate([a.odometry.relative, step, b.odometry.relative]),
        covariance=np.concatenate([a.odometry.covariance, loose, b.odometry.covariance]),
    )
    boxes = _core.BoxTable(
        pose=np.concatenate([a.boxes.pose, b.boxes.pose + before]),
        object=np.concatenate([a.boxes.object, row_of_b[b.boxes.object]]),
        box=np.concatenate([a.boxes.box, b.boxes.box]),
        covariance=np.concatenate([a.boxes.covariance, b.boxes.covariance]),
        truncated=np.concatenate([a.boxes.truncated, b.boxes.truncated]),
    )
    known = len(a.shared_sigma)
    prior = _core.SizePriorTable(
        log_mean=np.concatenate([a.size_prior.log_mean, b.size_prior.log_mean[new]]),
        log_sigma=np.concatenate([a.size_prior.log_sigma, b.size_prior.log_sigma[new]]),
        shared=np.concatenate([_shared_of(a), _behind(_shared_of(b)[new], known)]),
    )
    first, second = a.placements, b.placements
    placements = _core.PlacementTable(
        kind=[*first.kind, *second.kind],
        object=np.concatenate([first.object, row_of_b[second.object]]),
        other=np.concatenate([first.other, np.where(second.other < 0, -1, row_of_b[second.other])]),
        shared=np.concatenate([first.shared, _behind(second.shared.astype(np.int64), known)]),
        distance=np.concatenate([first.distance, second.distance]),
        sigma=np.concatenate([first.sigma, second.sigma]),
    )
    moved = [
        _core.MeasurementTable(
            kind=table.kind,
            pose=table.pose + before,
            object=row_of_b[table.object],
            value=table.value,
            covariance=table.covariance,
        )
        for table in b.measurements
    ]
    return rebuilt(
        a,
        initial_poses=initial,
        odometry=odometry,
        boxes=boxes,
        size_prior=prior,
        measurements=[*a.measurements, *moved],
        shared_sigma=np.concatenate([a.shared_sigma, b.shared_sigma]),
        placements=placements,
    )


def _shared_of(core: _core.Graph) -> Ints:
    """Return the shared number of each object's size prior, or -1, shape (o,)."""
    shared = core.size_prior.shared
    return np.array(shared if len(shared) else [-1] * core.num_objects, dtype=np.int64)


def _behind(shared: Ints, known: int) -> Ints:
    """Return rows of shared numbers behind those of another problem, shape (n,)."""
    return np.where(shared < 0, -1, shared + known)


def pose_of(matrix: Floats, model: _core.PoseModel) -> Floats:
    """Return a motion (4, 4) in the form of a pose, (d,)."""
    from scipy.spatial.transform import Rotation

    if model == _core.PoseModel.SE2:
        return np.array([*matrix[:2, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
    return np.concatenate([matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat()])


def moved_poses(frame: Floats, poses: Floats, model: _core.PoseModel) -> Floats:
    """Return poses (n, d) moved by a pose (d,), frame_from_theirs."""
    return np.asarray(_core.compose(model, np.tile(frame, (len(poses), 1)), poses))


def moved_ellipsoids(ellipsoids: Floats, b_from_a: Floats) -> Floats:
    """Return ellipsoids (o, 9) of B in the frame of A."""
    from scipy.spatial.transform import Rotation

    inverse = np.linalg.inv(b_from_a)
    turn = Rotation.from_matrix(inverse[:3, :3])
    moved = [
        _core.ellipsoid_from_axes(
            inverse[:3, :3] @ center + inverse[:3, 3],
            axes,
            (turn * Rotation.from_quat(orientation)).as_quat(),
        )
        for center, axes, orientation in map(_core.axes_from_ellipsoid, ellipsoids)
    ]
    return np.array(moved).reshape(-1, 9)
