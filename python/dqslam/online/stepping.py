"""A step of a session: checked, given to the core, its boxes identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam._checks import Floats
from dqslam._files import uninterrupted
from dqslam._ids import ObjectId, ObjectRow
from dqslam.association.noise import translation_axes
from dqslam.association.repeats import repeats_in_image
from dqslam.online.identify import Identifier
from dqslam.online.inputs import (
    CheckedBoxes,
    box_noise_rows,
    check_boxes,
    measurement_tables,
    motion_arrays,
    next_time,
)
from dqslam.online.state import RecentStep, State
from dqslam.online.step import Motion, StepBoxes, StepError, StepMeasurements, StepPositions
from dqslam.recording import tangent_size


@dataclass(frozen=True, eq=False)
class CheckedStep:
    """A step that a session takes: nothing in it is refused any more, now or later."""

    time: float
    relative: Floats
    covariance: Floats
    boxes: CheckedBoxes
    positions: StepPositions | None
    measurements: Sequence[StepMeasurements]


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the core is given, and the ids that it does not know."""

    observations: _core.StepObservations
    ids: list[ObjectId]
    """Ids that are believed, of the boxes that have one."""
    names: list[str]
    """Their classes."""
    new: list[ObjectId]
    """Ids of new objects, in their order."""
    rows: list[ObjectRow]
    """Rows of the objects of ``ids``."""
    object_rows: NDArray[np.int32]
    """Row of each box, -1 for one that waits."""


def check_step(
    state: State,
    odometry: Motion | None,
    boxes: StepBoxes | None,
    timestamp: float | None,
    positions: StepPositions | None,
    measurements: Sequence[StepMeasurements],
    *,
    dry_run: bool,
) -> tuple[CheckedStep, Prepared | None]:
    """Check a step against a session, which does not change.

    Returns the step and, unless something else changes before it is taken, what the core is given.

    Parameters
    ----------
    dry_run
        Whether a copy of the core takes the step, too: its refusal, which the other checks should
        have foreseen, would come too late once something else has changed.

    Raises
    ------
    StepError
        If the step is wrong.
    """
    settings, count = state.settings, len(state.timestamps)
    try:
        estimated = state.core.pose_at(count - 1) if count else state.begin[0]
        relative, covariance = motion_arrays(
            odometry,
            None if count else state.begin,
            _step_covariance(state),
            settings.pose_model,
            np.stack([estimated, state.odometry_end]),
        )
        step = CheckedStep(
            time=next_time(state.timestamps[-1] if count else None, timestamp),
            relative=relative,
            covariance=covariance,
            boxes=check_boxes(boxes, settings.camera, state.embedding_size),
            positions=positions,
            measurements=measurements,
        )
        prepared = _prepare(state, step)
        if dry_run:
            state.core.clone().add(relative, covariance, prepared.observations)
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise StepError(f"step {count}: {error}") from None
    return step, None if dry_run else prepared


def take_step(
    state: State, identifier: Identifier, step: CheckedStep, prepared: Prepared | None
) -> _core.StepReport:
    """Add a step to a session, as a whole: Ctrl-C waits. See ``OnlineSlam.add``."""
    with uninterrupted():
        return _take_step(state, identifier, step, prepared)


def _take_step(
    state: State, identifier: Identifier, step: CheckedStep, prepared: Prepared | None
) -> _core.StepReport:
    registry, count = state.registry, len(state.timestamps)
    try:
        prepared = prepared or _prepare(state, step)
        report = state.core.add(step.relative, step.covariance, prepared.observations)
    except (ValueError, TypeError) as error:
        raise StepError(f"step {count}: {error}") from None
    registry.register(prepared.new)
    for row, name in zip(prepared.rows, prepared.names, strict=True):
        registry.votes[row][name] += 1
    if len(step.boxes.box):
        state.embedding_size = step.boxes.embedding.shape[1]
    state.timestamps.append(step.time)
    state.given_ids.append(step.boxes.object_id)
    state.recent.append(RecentStep(step.relative, step.covariance, step.boxes))
    state.shown = step.boxes.object_id
    if count:
        model, end = state.settings.pose_model, state.odometry_end[None]
        state.odometry_end = _core.compose(model, end, step.relative[None])[0]
        identifier.integrate(step.relative, step.covariance)
    object_rows = prepared.object_rows
    waiting = np.flatnonzero(object_rows < 0)
    if waiting.size:
        # Of boxes that were drawn twice on one thing, the first counts; the others wait for good.
        counts = repeats_in_image(step.boxes.box[waiting])
        single = np.unique(counts)
        observation_rows = report.first_observation + waiting[single]
        # What overflows after a jump over the globe is not determined, and compares as false.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = identifier.identify(step.boxes, waiting[single], observation_rows)
        object_rows[waiting[single]] = found
        report.covariance = state.core.last_covariance  # a keyframe may have moved the pose
        shown = object_rows.copy()
        shown[waiting] = object_rows[waiting[counts]]
        state.shown = np.array([*registry.ids, -1], dtype=np.int64)[shown]
    return report


def _prepare(state: State, step: CheckedStep) -> Prepared:
    settings, registry, boxes = state.settings, state.registry, step.boxes
    believed = boxes.object_id.tolist() if settings.believes_ids else []
    known = [place for place, one in enumerate(believed) if one >= 0]
    ids = [believed[place] for place in known]
    names = [boxes.class_name[place] for place in known]
    rows, new = registry.rows_of(ids)
    priors = [state.prior.of(names[place]) for place in new]
    object_rows = np.full(len(boxes.box), -1, dtype=np.int32)
    object_rows[known] = rows
    observations = _core.StepObservations(
        object=object_rows,
        box=boxes.box,
        covariance=box_noise_rows(settings.box_noise, boxes.box, settings.camera),
        truncated=boxes.truncated,
        measurements=measurement_tables(step.positions, step.measurements, registry),
        log_size_mean=np.array([prior.log_mean for prior in priors]),
        log_size_sigma=np.array([prior.log_sigma for prior in priors]),
    )
    return Prepared(observations, ids, names, [ids[place] for place in new], rows, object_rows)


def _step_covariance(state: State) -> Floats | None:
    """Return the covariance that is estimated of a step, (k, k), if it is."""
    noise = state.odometry_noise
    if noise is None:
        return None
    k = tangent_size(state.settings.pose_model)
    sigma = np.where(np.arange(k) < translation_axes(k), noise.translation_m, noise.rotation_rad)
    return np.diag(sigma**2)
