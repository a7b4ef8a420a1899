"""Problems of the core with other tables, or with a part of the objects or poses."""

from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Ints
from dqslam.layout import flat
from dqslam.recording import Odometry
from dqslam.recording.odometry import compose_covariance


def rebuilt(core: _core.Graph, **changes: Any) -> _core.Graph:
    """Return a problem with some of its tables replaced."""
    names = (
        "initial_poses",
        "odometry",
        "boxes",
        "size_prior",
        "measurements",
        "scene_priors",
        "shapes",
        "shared_sigma",
        "placements",
    )
    tables = {name: getattr(core, name) for name in names} | changes
    return _core.Graph(core.pose_model, core.camera, **tables)


def only_objects(core: _core.Graph, kept: Bools) -> _core.Graph:
    """Return a problem with the objects `kept` (o,) only, and with their measurements only."""
    return select_objects(core, np.flatnonzero(kept))


def select_objects(core: _core.Graph, rows: Ints) -> _core.Graph:
    """Return a problem with some objects only, in the order of their rows (p,)."""
    place = np.full(core.num_objects, -1)
    place[rows] = np.arange(len(rows))
    boxes, prior = core.boxes, core.size_prior
    box = place[boxes.object] >= 0
    return rebuilt(
        core,
        boxes=_core.BoxTable(
            pose=boxes.pose[box],
            object=place[boxes.object[box]],
            box=boxes.box[box],
            covariance=boxes.covariance[box],
            truncated=boxes.truncated[box],
        ),
        size_prior=_core.SizePriorTable(
            log_mean=prior.log_mean[rows],
            log_sigma=prior.log_sigma[rows],
            shared=prior.shared[rows] if len(prior.shared) else prior.shared,
        ),
        placements=_placements_of(core.placements, place),
        measurements=[_of_kept(table, place) for table in core.measurements],
        shapes=[core.shapes[row] for row in rows.tolist()] if core.shapes else [],
    )


def select_poses(core: _core.Graph, rows: Ints) -> _core.Graph:
    """Return a problem with some poses only, ascending (f,), and odometry composed between them.

    To first order in the noise, it costs as much as the whole problem does with the others at their
    best. Boxes and measurements must be at poses that stay. With loop closures, all of them do.
    """
    steps, chain = core.odometry, np.arange(core.num_poses - 1)
    if not (np.array_equal(steps.from_pose, chain) and np.array_equal(steps.to_pose, chain + 1)):
        return core
    k = int(np.sqrt(steps.covariance.shape[1]))
    odometry = Odometry(
        core.pose_model,
        core.initial_poses[0],
        steps.relative,
        steps.covariance.reshape(-1, k, k),
    )
    path = _core.dead_reckon(core.pose_model, odometry.first_pose, odometry.relative)[rows]
    place = np.full(core.num_poses, -1)
    place[rows] = np.arange(len(rows))
    boxes, ends = core.boxes, np.arange(len(rows) - 1)
    return rebuilt(
        core,
        initial_poses=core.initial_poses[rows],
        odometry=_core.OdometryTable(
            from_pose=ends,
            to_pose=ends + 1,
            relative=_core.between(core.pose_model, path[:-1], path[1:]),
            covariance=flat(compose_covariance(odometry, odometry.covariance, rows)),
        ),
        boxes=_core.BoxTable(
            pose=place[boxes.pose],
            object=boxes.object,
            box=boxes.box,
            covariance=boxes.covariance,
            truncated=boxes.truncated,
        ),
        measurements=[
            _core.MeasurementTable(
                kind=table.kind,
                pose=place[table.pose],
                object=table.object,
                value=table.value,
                covariance=table.covariance,
            )
            for table in core.measurements
        ],
    )


def _placements_of(table: _core.PlacementTable, place: Ints) -> _core.PlacementTable:
    part = (place[table.object] >= 0) & ((table.other < 0) | (place[table.other] >= 0))
    return _core.PlacementTable(
        kind=[kind for kind, keep in zip(table.kind, part, strict=True) if keep],
        object=place[table.object[part]],
        other=np.where(table.other[part] < 0, -1, place[table.other[part]]),
        shared=table.shared[part],
        distance=table.distance[part],
        sigma=table.sigma[part],
    )


def _of_kept(table: _core.MeasurementTable, place: Ints) -> _core.MeasurementTable:
    part = place[table.object] >= 0
    return _core.MeasurementTable(
        kind=table.kind,
        pose=table.pose[part],
        object=place[table.object[part]],
        value=table.value[part],
        covariance=table.covariance[part],
    )
