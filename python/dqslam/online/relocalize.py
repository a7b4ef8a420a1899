"""The pose of the robot in a known map, from a few boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.online.inputs import CheckedBoxes, box_noise_rows, check_boxes
from dqslam.online.maps import MapOfSession
from dqslam.online.readout import read_objects
from dqslam.online.state import State
from dqslam.online.step import StepBoxes
from dqslam.places.location import PlaceMap, locate
from dqslam.places.upright import find_up
from dqslam.recording import Detections

# The least number of boxes of known objects: it determines the pose.
MIN_BOXES = {_core.PoseModel.SE2: 2, _core.PoseModel.SE3: 3}
# Where some boxes have ids and others classes alone, other objects of a class may fit by chance.
MIN_BOXES_OF_BOTH = 4
# The least probability of a pose that is found by classes alone.
MIN_CONFIDENCE = 0.95
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
    covariances = np.array([known.get(row, _UNKNOWN_COVARIANCE) for row in state.object_rows])
    covariances = covariances.reshape(-1, 9, 9)
    ids, names = objects.object_ids, np.array(objects.class_names, dtype=np.str_)
    shown = checked.object_id
    if (shown < 0).all() and len(ids) and len(checked.box):
        shown = _ids_by_classes(state, checked, covariances)
        candidates = [np.flatnonzero(ids == one).tolist() if one >= 0 else [] for one in shown]
    else:
        candidates = [
            np.flatnonzero(ids == one if one >= 0 else names == name).tolist()
            for one, name in zip(shown.tolist(), checked.class_name, strict=True)
        ]
    are_of_both = bool((checked.object_id >= 0).any() and (checked.object_id < 0).any())
    found = _core.relocalize(
        settings.pose_model,
        settings.camera,
        objects.ellipsoids,
        covariances.reshape(-1, 81),
        checked.box,
        box_noise_rows(settings.box_noise, checked.box, settings.camera),
        checked.truncated,
        candidates,
        MIN_BOXES_OF_BOTH if are_of_both else MIN_BOXES[settings.pose_model],
    )
    if found.runner_up < found.chi_square + MIN_CHI2_MARGIN:
        raise ValueError(
            f"relocalize: ambiguous, {found.matches} boxes fit at "
            f"{np.round(found.pose, 2).tolist()} as well as at {np.round(found.other, 2).tolist()}"
        )
    return Relocation(
        found.pose, found.covariance, np.append(ids, -1)[found.object], found.chi_square
    )


def _ids_by_classes(state: State, checked: CheckedBoxes, covariances: Floats) -> Ints:
    """Return the id of the object that each box shows, -1 for none, by the classes; (b,).

    Raises
    ------
    ValueError
        If they do not tell, with the reason.
    """
    settings, objects = state.settings, read_objects(state)
    upright = None
    if state.core.num_poses:
        model, camera = settings.pose_model, settings.camera
        upright = find_up(_core.world_from_camera(model, camera, state.core.poses))
    place = PlaceMap.of_objects(
        objects.object_ids,
        objects.class_names,
        objects.ellipsoids,
        covariances,
        box_noise=settings.box_noise,
        upright=upright,
    )
    names = sorted(set(checked.class_name))
    count = len(checked.box)
    detections = Detections(
        pose=np.zeros(count, dtype=np.int64),
        box=checked.box,
        score=np.ones(count),
        class_id=np.array([names.index(name) for name in checked.class_name], dtype=np.int64),
        object_id=np.full(count, -1),
        class_names=dict(enumerate(names)),
        truncated=checked.truncated,
    )
    found = locate(place, detections, settings.camera, min_confidence=MIN_CONFIDENCE)
    if not found.is_found:
        raise ValueError(f"relocalize: {found.reason}")
    return found.object_id
