"""Which object a box shows, where nothing but the map tells: gating against it, step by step.

A box is given to an object of the map if it clearly shows it, by the gate and the costs that the
association of whole recordings has; other boxes wait in tracklets, linked by their overlap in the
image, and become an object when a tracklet is long enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.associate.assignment import assign
from dqslam.associate.gating import pair_costs, predict_boxes
from dqslam.evaluate import box_iou
from dqslam.online.objects import Registry
from dqslam.online.step import CheckedBoxes
from dqslam.problem import BoxNoise

# -2 ln of the odds, 20 to 1: what is less clear waits.
CLEAR = 6.0
# Of the box before in its tracklet.
LEAST_OVERLAP = 0.3
# Boxes of a tracklet before it becomes an object: a false alarm lasts no longer.
BIRTH = 3
# How well the map is known, beside the motion of one step: sigmas of the centre [m] and of the
# shape. The window does not keep joint covariances.
_CENTER_SIGMA_M, _SHAPE_SIGMA = 0.1, 0.1
_WRONG_CLASS = 0.02


@dataclass
class Track:
    """Boxes that follow each other."""

    number: int
    """Object, or -1 while it waits."""
    box: Floats
    length: int


class Identifier:
    """Gives boxes of unknown objects to objects."""

    def __init__(self, camera: _core.Camera, pose_model: _core.PoseModel) -> None:
        """Begin without tracks."""
        self._camera = camera
        self._pose_model = pose_model
        self.tracks: list[Track] = []

    def identify(
        self,
        session: _core.Session,
        registry: Registry,
        boxes: CheckedBoxes,
        relative: Floats,
        motion_covariance: Floats,
        noise: BoxNoise,
    ) -> tuple[Ints, list[Track]]:
        """Return the object of each box (b,), -1 for one that waits, and what to follow next.

        Nothing changes until `tracks` is set: the step may yet be refused.
        """
        chosen = self._by_map(session, registry, boxes, relative, motion_covariance, noise)
        taken = set(chosen[chosen >= 0].tolist())
        next_id = registry.next_id()
        waiting = list(self.tracks)
        tracks = []
        for row in range(len(boxes.ids)):
            track = _take_track(waiting, boxes.box[row])
            length = 1 if track is None else track.length + 1
            number = boxes.ids[row] if boxes.ids[row] >= 0 else int(chosen[row])
            if number < 0 and track is not None and track.number >= 0:
                number = track.number if track.number not in taken else -1
            if number < 0 and length >= BIRTH:
                number, next_id = next_id, next_id + 1
            if number >= 0:
                taken.add(number)
            chosen[row] = number
            tracks.append(Track(number, boxes.box[row], length))
        return chosen, tracks

    def _by_map(
        self,
        session: _core.Session,
        registry: Registry,
        boxes: CheckedBoxes,
        relative: Floats,
        motion_covariance: Floats,
        noise: BoxNoise,
    ) -> Ints:
        """Return the object that each box clearly shows by the map, -1 for none; shape (b,)."""
        chosen = np.full(len(boxes.ids), -1)
        count = session.num_objects
        if not count or not session.num_poses:
            return chosen
        last = session.pose_at(session.num_poses - 1)
        pose = _core.compose(self._pose_model, last[None], relative[None])[0]
        near = np.arange(count)
        ellipsoids = session.ellipsoids
        _, in_front = _core.project_to_boxes(
            self._pose_model, self._camera, np.repeat(pose[None], count, axis=0), ellipsoids
        )
        near = near[in_front]
        if not near.size:
            return chosen
        k = 3 if self._pose_model == _core.PoseModel.SE2 else 6
        own = [_CENTER_SIGMA_M] * 3 + [_SHAPE_SIGMA] * 6
        sigma = np.concatenate([np.zeros(k), np.tile(own, len(near))])
        joint = np.diag(sigma**2)
        joint[:k, :k] = motion_covariance
        predicted = predict_boxes(self._camera, self._pose_model, pose, ellipsoids[near], joint)
        shown = near[predicted.object_row]
        if not shown.size:
            return chosen
        names = registry.class_names()
        probability = np.array(
            [
                [1.0 if names[row] == name else _WRONG_CLASS for row in shown]
                for name in boxes.class_name
            ]
        )
        covariance = noise.covariance(boxes.box)
        costs = pair_costs(
            self._camera, predicted, boxes.box, covariance, boxes.truncated, probability
        )
        column, margin = assign(costs.cost, costs.null)
        clear = (column >= 0) & (margin >= CLEAR)
        ids = np.array(registry.ids)
        chosen[clear] = ids[shown[column[clear]]]
        return chosen


def _take_track(tracks: list[Track], box: Floats) -> Track | None:
    """Take out the track whose last box overlaps this one most."""
    if not tracks:
        return None
    overlap = box_iou(np.array([track.box for track in tracks]), box)
    best = int(np.argmax(overlap))
    return tracks.pop(best) if overlap[best] >= LEAST_OVERLAP else None
