"""Problems of the core with other tables, or with a part of the objects."""

from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Ints


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
    row = np.cumsum(kept) - 1
    boxes, prior = core.boxes, core.size_prior
    box = kept[boxes.object]
    return rebuilt(
        core,
        boxes=_core.BoxTable(
            pose=boxes.pose[box],
            object=row[boxes.object[box]],
            box=boxes.box[box],
            covariance=boxes.covariance[box],
            truncated=boxes.truncated[box],
        ),
        size_prior=_core.SizePriorTable(
            log_mean=prior.log_mean[kept],
            log_sigma=prior.log_sigma[kept],
            shared=prior.shared[kept] if len(prior.shared) else prior.shared,
        ),
        placements=_placements_of(core.placements, kept, row),
        measurements=[_only_kept(table, kept, row) for table in core.measurements],
        shapes=[shape for shape, keep in zip(core.shapes, kept, strict=True) if keep]
        if core.shapes
        else [],
    )


def _placements_of(table: _core.PlacementTable, kept: Bools, row: Ints) -> _core.PlacementTable:
    part = kept[table.object] & ((table.other < 0) | kept[table.other])
    return _core.PlacementTable(
        kind=[kind for kind, keep in zip(table.kind, part, strict=True) if keep],
        object=row[table.object[part]],
        other=np.where(table.other[part] < 0, -1, row[table.other[part]]),
        shared=table.shared[part],
        distance=table.distance[part],
        sigma=table.sigma[part],
    )


def _only_kept(table: _core.MeasurementTable, kept: Bools, row: Ints) -> _core.MeasurementTable:
    part = kept[table.object]
    return _core.MeasurementTable(
        kind=table.kind,
        pose=table.pose[part],
        object=row[table.object[part]],
        value=table.value[part],
        covariance=table.covariance[part],
    )
