"""A step of a session: checked, given to the core, its boxes identified."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.association.noise import translation_axes
from dqslam.online.identify import Identifier
from dqslam.online.inputs import (
    box_noise_rows,
    check_boxes,
    measurement_tables,
    motion_arrays,
    next_time,
)
from dqslam.online.state import State
from dqslam.online.step import Motion, StepBoxes, StepError, StepMeasurements, StepPositions
from dqslam.recording import tangent_size


def take_step(
    state: State,
    identifier: Identifier,
    odometry: Motion | None,
    boxes: StepBoxes | None,
    timestamp: float | None,
    positions: StepPositions | None,
    measurements: Sequence[StepMeasurements],
) -> _core.StepReport:
    """Add a step to a session; see ``OnlineSlam.add``."""
    settings, registry = state.settings, state.registry
    count = len(state.timestamps)
    try:
        time = next_time(state.timestamps[-1] if count else None, timestamp)
        checked = check_boxes(boxes)
        begin = None if count else state.begin
        relative, covariance = motion_arrays(odometry, begin, _step_covariance(state))
        believed = checked.object_id.tolist() if settings.believes_ids else []
        known = [place for place, one in enumerate(believed) if one >= 0]
        ids = [believed[place] for place in known]
        names = [checked.class_name[place] for place in known]
        rows, new = registry.rows_of(ids)
        priors = [state.prior.of(names[place]) for place in new]
        object_rows = np.full(len(checked.box), -1, dtype=np.int32)
        object_rows[known] = rows
        observations = _core.StepObservations(
            object=object_rows,
            box=checked.box,
            covariance=box_noise_rows(settings.box_noise, checked.box, settings.camera),
            truncated=checked.truncated,
            measurements=measurement_tables(positions, measurements, registry),
            log_size_mean=np.array([prior.log_mean for prior in priors]),
            log_size_sigma=np.array([prior.log_sigma for prior in priors]),
        )
        report = state.core.add(relative, covariance, observations)
    except (ValueError, TypeError) as error:
        raise StepError(f"step {count}: {error}") from None
    registry.register(ids[place] for place in new)
    for row, name in zip(rows, names, strict=True):
        registry.votes[row][name] += 1
    state.timestamps.append(time)
    state.given_ids.append(checked.object_id)
    state.shown = checked.object_id
    if count:
        identifier.integrate(relative, covariance)
    if len(known) < len(object_rows):
        waiting = np.flatnonzero(object_rows < 0)
        observation_rows = report.first_observation + waiting
        object_rows[waiting] = identifier.identify(checked, waiting, observation_rows)
        state.shown = np.array([*registry.ids, -1], dtype=np.int64)[object_rows]
    return report


def _step_covariance(state: State) -> Floats | None:
    """Return the covariance that is estimated of a step, (k, k), if it is."""
    noise = state.odometry_noise
    if noise is None:
        return None
    k = tangent_size(state.settings.pose_model)
    sigma = np.where(np.arange(k) < translation_axes(k), noise.translation_m, noise.rotation_rad)
    return np.diag(sigma**2)
