"""Where the robot is in a known map, from a few boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.online.objects import Objects
from dqslam.online.step import CheckedBoxes, StepBoxes

# Boxes that are needed: of known objects, and where only classes are known.
FEWEST_KNOWN = {_core.PoseModel.SE2: 2, _core.PoseModel.SE3: 3}
FEWEST_UNKNOWN = 4
# Another place is as good if its chi-square is no more than this above: 20 to 1 (2 ln 20).
AMBIGUOUS = 6.0
# Where the covariance of an object is unknown, m^2 and log meters: a centimeter or so.
_UNKNOWN = np.diag([1e-4] * 3 + [1e-3] * 3 + [1e-4] * 3)


@dataclass(frozen=True, eq=False)
class Relocation:
    """A pose in a map."""

    pose: Floats
    """world_from_robot, shape (d,)."""
    covariance: Floats
    """In the tangent of the pose, translation first, the map's errors included; shape (k, k)."""
    object_id: Ints
    """Which object each box shows, -1 for none; shape (b,)."""
    chi_square: float
    """Of the boxes that show one, 4 degrees of freedom each."""

    def with_ids(self, boxes: StepBoxes) -> StepBoxes:
        """Return the boxes that show objects of the map, with these objects' ids."""
        known = self.object_id >= 0
        rows = np.flatnonzero(known)
        return replace(
            boxes,
            box=np.asarray(boxes.box)[known],
            object_id=self.object_id[known],
            class_name=tuple(boxes.class_name[row] for row in rows.tolist())
            if boxes.class_name
            else (),
            truncated=None if boxes.truncated is None else np.asarray(boxes.truncated)[known],
        )


def relocalize(
    camera: _core.Camera,
    pose_model: _core.PoseModel,
    objects: Objects,
    covariances: Mapping[int, Floats],
    boxes: CheckedBoxes,
    box_covariance: Floats,
) -> Relocation:
    """Find the pose; see ``OnlineSlam.relocalize``. Covariances (9, 9) are by row of objects."""
    row_of_id = {number: row for row, number in enumerate(objects.ids.tolist())}
    candidates = []
    for number, name in zip(boxes.ids, boxes.class_name, strict=True):
        if number >= 0:
            candidates.append([row_of_id[number]] if number in row_of_id else [])
        else:
            same = [row for row, other in enumerate(objects.class_names) if other == name]
            candidates.append(same)
    is_known = all(number >= 0 for number in boxes.ids)
    spread = np.array([covariances.get(row, _UNKNOWN) for row in range(len(objects))])
    found = _core.relocalize(
        pose_model,
        camera,
        objects.ellipsoids,
        spread.reshape(-1, 81),
        boxes.box,
        box_covariance,
        boxes.truncated,
        candidates,
        FEWEST_KNOWN[pose_model] if is_known else FEWEST_UNKNOWN,
    )
    if found.runner_up < found.chi_square + AMBIGUOUS:
        raise ValueError(
            f"relocalize: ambiguous, {found.matches} boxes fit at "
            f"{np.round(found.pose, 2).tolist()} as well as at {np.round(found.other, 2).tolist()}"
        )
    shown = np.append(objects.ids, -1)[found.object]
    return Relocation(found.pose, found.covariance, shown, found.chi_square)
