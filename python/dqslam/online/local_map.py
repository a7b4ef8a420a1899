"""A part of a session's path as the association works on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam.association.labels import Labels
from dqslam.association.noise import StepNoise
from dqslam.association.scene_map import SceneMap
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.state import State
from dqslam.recording import Detections, Odometry, Recording, tangent_size


@dataclass(eq=False)
class LocalMap:
    """The keyframes from ``begin`` on, where the session has them, and what may become of them."""

    scene: SceneMap
    begin: int
    first_box: int
    """Row of its first box in the store."""
    base: Labels
    """Of the store, when it and the map last agreed."""


def local_map(state: State, begin: int) -> LocalMap:
    """Return the keyframes from ``begin`` on, their boxes labeled as the store has them."""
    settings, store = state.settings, state.store
    store.labels.make_room(objects=state.core.num_objects)
    frames = store.keyframes[begin:]
    poses = state.core.poses_at([frame.pose for frame in frames])
    steps = [frame.odometry for frame in frames[1:]]
    k = tangent_size(settings.pose_model)
    relative = np.array([step.relative for step in steps]).reshape(-1, poses.shape[1])
    covariances = np.array([step.covariances for step in steps]).reshape(-1, 3, k, k)
    odometry = Odometry(settings.pose_model, poses[0], relative, covariances[:, 0])
    noise = StepNoise.isotropic(covariances[:, 1], covariances[:, 2])
    believed = store.odometry_noise
    first_box = int(np.searchsorted(store.box_keyframe, begin))
    labels = store.labels.since(first_box)
    times = np.array([frame.timestamp for frame in frames])
    scene = SceneMap(
        Recording(settings.camera, times, odometry, _detections(store, begin, labels)),
        labels,
        box_noise=settings.box_noise,
        size_prior=store.size_prior,
        step_noise=noise if settings.estimates_noise else None,
        levels=np.array([believed.translation_m, believed.rotation_rad]),
    )
    scene.learns_size = settings.size_prior is None
    scene.poses = poses
    scene.ellipsoids = state.core.ellipsoids
    scene.observation_rows = store.observation_rows[first_box:]
    scene.prior_covariance = store.map_covariance
    return LocalMap(scene, begin, first_box, store.snapshot())


def _detections(store: KeyframeStore, begin: int, labels: Labels) -> Detections:
    boxes = [frame.boxes for frame in store.keyframes[begin:]]
    count = [len(one.box) for one in boxes]
    return Detections(
        pose=np.repeat(np.arange(len(boxes)), count),
        box=np.concatenate([one.box for one in boxes]),
        score=np.ones(sum(count)),
        class_id=labels.box_class,
        object_id=np.full(sum(count), -1),
        class_names=store.class_names,
        truncated=np.concatenate([one.truncated for one in boxes]),
        embedding=np.concatenate([one.embedding for one in boxes]),
    )
