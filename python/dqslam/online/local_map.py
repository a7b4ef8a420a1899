"""A part of a session's path as the association has a map of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association.noise import StepNoise
from dqslam.association.scene_map import SceneMap
from dqslam.assumptions import BoxNoise
from dqslam.online.keyframes import Journal, Keyframe
from dqslam.recording import Detections, Odometry, Recording


@dataclass(frozen=True)
class Assumptions:
    """What a session takes for granted, as the association wants it."""

    camera: _core.Camera
    pose_model: _core.PoseModel
    box_noise: BoxNoise
    learns_size: bool
    """Whether the objects found tell the size of others."""
    estimates_noise: bool
    """Whether the boxes tell the level of the odometry's noise."""


@dataclass(eq=False)
class Part:
    """The keyframes from ``begin`` on as the association has a map, and as they were before."""

    scene: SceneMap
    begin: int
    box_object: Ints
    """What the boxes showed when that was last the same here and there, shape (m,)."""
    tracklet: Ints
    """Their tracklets then, shape (m,)."""
    object_of_tracklet: dict[int, int]
    left_out: dict[int, str]
    objects: int
    """How many objects there were then."""

    @classmethod
    def of(cls, scene: SceneMap, begin: int) -> Part:
        """Take a map that agrees with the journal."""
        part = cls(scene, begin, scene.box_object, scene.tracklet, {}, {}, 0)
        part.is_taken()
        return part

    def born(self) -> list[int]:
        """Return the rows of objects that are new and have boxes."""
        shown = np.unique(self.scene.box_object)
        return [int(row) for row in shown[shown >= self.objects]]

    def is_taken(self) -> None:
        """Remember that what has changed is known."""
        self.box_object = self.scene.box_object.copy()
        self.tracklet = self.scene.tracklet.copy()
        self.object_of_tracklet = dict(self.scene.object_of_tracklet)
        self.left_out = dict(self.scene.left_out)
        self.objects = len(self.scene.ellipsoids)
        self.scene.joined.clear()


def cut_part(
    journal: Journal,
    assumptions: Assumptions,
    session: _core.Session,
    begin: int,
    *,
    free_tracklet: int,
) -> Part:
    """Return the keyframes from ``begin`` on as a map, where the session has them now."""
    frames = journal.keyframes[begin:]
    poses = session.poses_at([frame.pose for frame in frames])
    legs = [frame.leg for frame in frames[1:]]
    k = 3 if assumptions.pose_model == _core.PoseModel.SE2 else 6

    def stacked(matrices: list[Floats]) -> Floats:
        return np.array(matrices).reshape(-1, k, k)

    odometry = Odometry(
        assumptions.pose_model,
        poses[0],
        np.array([leg.relative for leg in legs]).reshape(-1, poses.shape[1]),
        stacked([leg.covariance for leg in legs]),
    )
    noise = StepNoise(
        stacked([leg.per_translation for leg in legs]), stacked([leg.per_rotation for leg in legs])
    )
    times = np.array([frame.timestamp for frame in frames])
    scene = SceneMap(
        Recording(assumptions.camera, times, odometry, _detections(journal, frames)),
        np.concatenate([frame.tracklet for frame in frames]),
        box_noise=assumptions.box_noise,
        size_prior=journal.size_prior,
        step_noise=noise if assumptions.estimates_noise else None,
        odometry_noise=journal.odometry_noise,
    )
    journal.know_objects(session.num_objects)
    scene.learns_size = assumptions.learns_size
    scene.poses = poses
    scene.ellipsoids = session.ellipsoids
    scene.box_name = np.concatenate([frame.sight for frame in frames])
    scene.box_object = np.concatenate([frame.object for frame in frames])
    scene.votes = journal.votes.copy()
    own = journal.object_of_tracklet
    known = [number for number in np.unique(scene.tracklet).tolist() if number in own]
    scene.object_of_tracklet = {number: own[number] for number in known}
    scene.left_out = dict(journal.left_out)
    scene.prior_covariance = journal.map_covariance
    scene.free_tracklet = free_tracklet
    return Part.of(scene, begin)


def _detections(journal: Journal, frames: list[Keyframe]) -> Detections:
    count = [len(frame.box) for frame in frames]
    return Detections(
        pose=np.repeat(np.arange(len(frames)), count),
        box=np.concatenate([frame.box for frame in frames]),
        score=np.ones(sum(count)),
        class_id=np.concatenate([frame.class_id for frame in frames]),
        object_id=np.full(sum(count), -1),
        class_names=dict(enumerate(journal.class_names)),
        truncated=np.concatenate([frame.truncated for frame in frames]),
    )
