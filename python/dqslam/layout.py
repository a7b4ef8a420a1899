"""The tables of a recording's problem, as the core takes them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints, reject_rows
from dqslam.assumptions import UNKNOWN_SIZE, ClassShapes, SizePrior, SizePriors
from dqslam.recording import Detections, LoopClosures, Measurements, Odometry, Recording


def size_priors_of(
    given: SizePrior | SizePriors | None, class_names: tuple[str, ...], detections: Detections
) -> list[SizePrior]:
    """Return the prior of each object, for their class names (o,)."""
    if isinstance(given, SizePriors):
        given.check_classes(set(detections.class_names.values()))
        return [given.of(name) for name in class_names]
    return [UNKNOWN_SIZE if given is None else given] * len(class_names)


def unknown_medians(priors: list[SizePrior]) -> list[SizePrior]:
    """Return the different priors whose median is unknown; each has a shared number."""
    return list(dict.fromkeys(prior for prior in priors if prior.median_log_sigma != 0.0))


def size_prior_table(priors: list[SizePrior], medians: list[SizePrior]) -> _core.SizePriorTable:
    """Return the prior of each object, with the rows of the unknown medians."""
    return _core.SizePriorTable(
        log_mean=np.array([prior.log_mean for prior in priors]),
        log_sigma=np.array([prior.log_sigma for prior in priors]),
        shared=np.array(
            [medians.index(prior) if prior in medians else -1 for prior in priors], dtype=np.int64
        ),
    )


def shapes_of(
    given: _core.Shape | ClassShapes | Mapping[str, _core.Shape] | None,
    class_names: tuple[str, ...],
    detections: Detections,
) -> list[_core.Shape]:
    """Return the shape of each object, for their class names (o,); none if all are ellipsoids."""
    if given is None:
        return []
    if isinstance(given, _core.Shape):
        return [given] * len(class_names)
    if not isinstance(given, ClassShapes):
        given = ClassShapes(given)
    classes, default = given.classes, given.default
    for name in classes:
        if name not in detections.class_names.values():
            names = ", ".join(sorted(set(detections.class_names.values())))
            raise ValueError(f"shapes: no class {name!r} in the recording, only: {names}")
    return [classes.get(name, default) for name in class_names]


def odometry_table(odometry: Odometry, closures: LoopClosures | None) -> _core.OdometryTable:
    """Lay out the steps, then the closures, which the core has as odometry back in time."""
    model, steps = odometry.pose_model, np.arange(len(odometry.relative))
    tables = [(steps, steps + 1, odometry.relative, odometry.covariance)]
    if closures is not None:
        first, second = closures.from_pose, closures.to_pose
        ahead = first < second
        # The inverse of to_in_from has its error in the frame of the first pose.
        adjoint = _core.adjoint(model, closures.relative)
        moved = adjoint @ closures.covariance @ adjoint.transpose(0, 2, 1)
        tables.append(
            (
                np.where(ahead, second, first),
                np.where(ahead, first, second),
                np.where(
                    ahead[:, None], _core.inverse(model, closures.relative), closures.relative
                ),
                np.where(ahead[:, None, None], moved, closures.covariance),
            )
        )
    from_pose, to_pose, relative, covariance = map(np.concatenate, zip(*tables, strict=True))
    return _core.OdometryTable(
        from_pose=from_pose, to_pose=to_pose, relative=relative, covariance=flat(covariance)
    )


def objects_of(detections: Detections) -> tuple[Ints, Ints, Ints]:
    """Return the object ids (o,), the row of each box's object (b,), and boxes per object (o,)."""
    if not len(detections):
        raise ValueError("detections: there are no boxes")
    unknown = detections.object_id < 0
    reject_rows("detections.object_id", unknown, "the box belongs to no object yet")
    object_ids, box_object, observations = np.unique(
        detections.object_id, return_inverse=True, return_counts=True
    )
    return object_ids, box_object.reshape(-1), observations


def class_names_of(detections: Detections, box_object: Ints, objects: int) -> tuple[str, ...]:
    """Return the class of most boxes of each object (o,), for the row of each box's object (b,)."""
    classes, box_class = np.unique(detections.class_id, return_inverse=True)
    votes = np.zeros((objects, len(classes)), dtype=np.int64)
    np.add.at(votes, (box_object, box_class.reshape(-1)), 1)
    return tuple(detections.class_names[int(classes[row])] for row in votes.argmax(axis=1))


def measurements_of(recording: Recording) -> list[Measurements]:
    """Return the measurements other than boxes, positions first."""
    positions = recording.positions
    if positions is None:
        return list(recording.measurements)
    of_centers = Measurements(
        "position",
        positions.pose,
        positions.object_id,
        positions.object_in_robot,
        positions.covariance,
    )
    return [of_centers, *recording.measurements]


def measurement_table(measured: Measurements, object_ids: Ints) -> _core.MeasurementTable:
    """Lay out measurements of objects, whose rows are those of ``object_ids`` (o,)."""
    has_no_box = ~np.isin(measured.object_id, object_ids)
    name = f"{measured.kind}s.object_id"
    reject_rows(name, has_no_box, "the object has no box", measured.object_id)
    return _core.MeasurementTable(
        kind=measured.kind,
        pose=measured.pose,
        object=np.searchsorted(object_ids, measured.object_id),
        value=measured.value,
        covariance=flat(measured.covariance),
    )


def flat(covariance: Floats) -> Floats:
    """Lay out matrices (m, k, k) as rows (m, k * k)."""
    return covariance.reshape(len(covariance), covariance.shape[1] ** 2)
