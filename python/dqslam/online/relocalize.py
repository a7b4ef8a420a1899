"""The pose of the robot in a known map, from a few boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.online.inputs import box_noise_rows, check_boxes
from dqslam.online.maps import MapOfSession
from dqslam.online.readout import read_objects
from dqslam.online.state import State
from dqslam.online.step import StepBoxes

# The least number of boxes. With ids, it is the number that determines the pose.
MIN_BOXES_WITH_IDS = {_core.PoseModel.SE2: 2, _core.PoseModel.SE3: 3}
# With classes alone it is larger, because other objects of a class may fit by chance.
MIN_BOXES_WITHOUT_IDS = 4
# A pose is ambiguous if the chi-square of another exceeds its own by less than this (2 ln 20).
MIN_CHI2_MARGIN = 6.0
# Covariance of an object if it is unknown, m^2 and log meters: about a centimeter.
_UNKNOWN_COVARIANCE = np.diag([1e-4] * 3 + [1e-3] * 3 + [1e-4] * 3)


@dataclass(frozen=True, eq=False)
class Relocation:
    """A pose in a map."""

    pose: Floats
    """world_from_robot, shape (d,)."""
    covariance: Floats
    """Covariance in the tangent of the pose, with the errors of the map; shape (k, k)."""
    object_id: Ints
    """Id of the object that each box shows, -1 for none; shape (b,)."""
    chi_square: float
    """Sum over the boxes that show an object, with 4 degrees of freedom each."""

    def with_ids(self, boxes: StepBoxes) -> StepBoxes:
        """Return the boxes that show objects of the map, with the ids of these objects."""
        known = np.flatnonzero(self.object_id >= 0)
        count = len(self.object_id)
        names = boxes.class_name or ("object",) * count
        truncated = np.zeros((count, 4)) if boxes.truncated is None else boxes.truncated
        return StepBoxes(
            np.asarray(boxes.box)[known],
            self.object_id[known],
            [names[row] for row in known.tolist()],
            np.asarray(truncated)[known],
        )


def relocalize(state: State, boxes: StepBoxes) -> Relocation:
    """Find the pose; see ``OnlineSlam.relocalize``."""
    settings, objects = state.settings, read_objects(state)
    checked = check_boxes(boxes, settings.camera)
    known = MapOfSession.of(state).covariances()
    covariances = [known.get(row, _UNKNOWN_COVARIANCE) for row in state.object_rows]
    ids, names = objects.object_ids, np.array(objects.class_names, dtype=np.str_)
    candidates = [
        np.flatnonzero(ids == one if one >= 0 else names == name).tolist()
        for one, name in zip(checked.object_id.tolist(), checked.class_name, strict=True)
    ]
    have_ids = bool((checked.object_id >= 0).all())
    found = _core.relocalize(
        settings.pose_model,
        settings.camera,
        objects.ellipsoids,
        np.array(covariances).reshape(-1, 81),
        checked.box,
        box_noise_rows(settings.box_noise, checked.box, settings.camera),
        checked.truncated,
        candidates,
        MIN_BOXES_WITH_IDS[settings.pose_model] if have_ids else MIN_BOXES_WITHOUT_IDS,
    )
    if found.runner_up < found.chi_square + MIN_CHI2_MARGIN:
        raise ValueError(
            f"relocalize: ambiguous, {found.matches} boxes fit at "
            f"{np.round(found.pose, 2).tolist()} as well as at {np.round(found.other, 2).tolist()}"
        )
    shown = np.append(ids, -1)[found.object]
    return Relocation(found.pose, found.covariance, shown, found.chi_square)
