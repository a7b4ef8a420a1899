"""Association along the path: predict, assign what is clear, start new objects, estimate, go on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association.assignment import assign
from dqslam.association.consistency import find_misfits, join_duplicates
from dqslam.association.gating import (
    CHI2_GATE,
    PredictedBoxes,
    in_image,
    pair_costs,
    predict_boxes,
)
from dqslam.association.initiation import FEWEST_VIEWS, propose_groups
from dqslam.association.scene_map import SceneMap
from dqslam.recording import Recording

# -2 ln of the odds, 20 to 1: what is less clear waits.
AMBIGUOUS = 6.0
# Images in a row in which a tracklet does not fit its object, before it is taken for another.
STRIKES = 3
# A path is followed in at most this many parts, of at least so many poses.
PARTS = 60
SHORTEST_PART = 3
# Poses before the level of the odometry's noise can be told, and parts between two estimates.
FIRST_NOISE = 10
NOISE_EVERY = 3
MAX_ITERATIONS = 12
# Boxes of a new object that fit, and how well its distance is known.
LEAST_FIT = 0.6
LARGEST_DEPTH_ERROR = 0.3


class Follower:
    """Follows a path part by part."""

    def __init__(self, scene: SceneMap, *, trust: float) -> None:
        """``trust`` is the probability that a tracklet stays with its object, 1 if that is sure."""
        self.scene = scene
        self.final = trust == 1.0
        self.bonus = np.inf if self.final else 2.0 * float(np.log(trust / (1.0 - trust)))
        self._strikes: dict[int, int] = {}
        self._failed: dict[tuple[int, ...], int] = {}

    def follow(self, progress: Callable[[float], None]) -> None:
        """Go along the whole path; ``progress`` is told the share that is done."""
        scene = self.scene
        end = len(scene.recording.timestamps)
        size = max(SHORTEST_PART, -(-end // PARTS))
        for part, begin in enumerate(range(1, end, size)):
            self.assign_ahead(begin, min(begin + size, end))
            self.give_birth()
            scene.estimate(max_iterations=MAX_ITERATIONS)
            if len(scene.poses) >= FIRST_NOISE and part % NOISE_EVERY == 0:
                scene.estimate_noise()
            if not self.final:
                join_duplicates(scene)
            scene.left_out = find_misfits(scene)
            progress(len(scene.poses) / end)

    def assign_ahead(self, begin: int, end: int, *, strangers_only: bool = False) -> None:
        """Go on by odometry to some poses, and give their boxes to the objects they clearly show.

        What is known of the path and the objects is that of the pose before ``begin``. Strangers
        are boxes that wait and whose tracklets have no object.
        """
        scene = self.scene
        scene.extend(end)
        known, covariance = scene.joint_covariance(begin - 1, self._in_view(begin, end))
        odometry = scene.recording.odometry
        k = odometry.covariance.shape[1]
        back = _core.inverse(odometry.pose_model, odometry.relative[begin - 1 : end - 1])
        moves = _core.adjoint(odometry.pose_model, back)
        for pose, moved in zip(range(begin, end), moves, strict=True):
            covariance[:k] = moved @ covariance[:k]
            covariance[:, :k] = covariance[:, :k] @ moved.T
            covariance[:k, :k] += odometry.covariance[pose - 1]
            self._assign(pose, known, covariance, strangers_only=strangers_only)

    def _in_view(self, begin: int, end: int) -> NDArray[np.int64]:
        """Return the objects that some of the poses should see; no other is predicted."""
        scene = self.scene
        known = np.flatnonzero(scene.box_counts > 0)
        camera, model = scene.recording.camera, scene.recording.odometry.pose_model
        shown = np.zeros(len(known), dtype=bool)
        for pose in scene.poses[begin:end]:
            shown |= in_image(camera, model, pose, scene.ellipsoids[known])
        return known[shown]

    def _assign(
        self,
        pose: int,
        known: NDArray[np.int64],
        covariance: NDArray[np.float64],
        *,
        strangers_only: bool,
    ) -> None:
        scene = self.scene
        rows = np.flatnonzero(scene.recording.detections.pose == pose)
        predicted = predict(scene, pose, known, covariance)
        if strangers_only:
            predicted = predicted.without(np.isin(known, scene.box_object[rows]))
            rows = rows[scene.are_strangers(rows)]
        if not rows.size or not len(predicted.box):
            return
        choice, margin = choose(scene, rows, known, predicted, self.bonus)
        for row, number, sure in zip(rows, choice.tolist(), margin, strict=True):
            tracklet = int(scene.tracklet[row])
            own = scene.object_of_tracklet.get(tracklet)
            if own is not None and own != number:
                if not self.final:
                    self._strike(tracklet, pose)
            elif number >= 0 and (own is not None or sure >= AMBIGUOUS):
                scene.claim(np.array([row]), np.array([number]))
                scene.object_of_tracklet[tracklet] = number
                self._strikes[tracklet] = 0

    def _strike(self, tracklet: int, pose: int) -> None:
        """Count that a tracklet does not fit its object; in the end, cut it in two."""
        self._strikes[tracklet] = self._strikes.get(tracklet, 0) + 1
        if self._strikes[tracklet] >= STRIKES:
            self.scene.cut_tracklet(tracklet, pose)

    def give_birth(self) -> None:
        """Start the objects that waiting boxes agree on."""
        scene = self.scene
        recording = scene.recording
        seen = np.flatnonzero(recording.detections.pose < len(scene.poses))
        waiting = seen[scene.are_strangers(seen)]
        if not waiting.size:
            return
        cameras = _core.world_from_camera(
            recording.odometry.pose_model, recording.camera, scene.poses
        )
        groups = [
            group
            for group in propose_groups(
                recording, cameras, waiting, scene.tracklet, tracklets_only=self.final
            )
            if len(group) > 1.25 * self._failed.get(tuple(scene.box_name[group[:3]]), 0)
        ]
        if not groups:
            return
        ellipsoids, spread = scene.fit_groups(groups)
        for group, ellipsoid, covariance in zip(groups, ellipsoids, spread, strict=True):
            middle = cameras[recording.detections.pose[group], :3].mean(axis=0)
            towards = ellipsoid[:3] - middle
            blur = _blur(recording, float(np.linalg.norm(towards)))
            chi2 = scene.chi2(group, np.tile(ellipsoid, (len(group), 1)), blur=blur)
            fits = chi2 <= CHI2_GATE[4]
            sure = _depth_error(towards, covariance) < LARGEST_DEPTH_ERROR
            if sure and fits.sum() >= FEWEST_VIEWS and fits.mean() >= LEAST_FIT:
                scene.add_object(ellipsoid, group[fits])
            else:
                self._failed[tuple(scene.box_name[group[:3]])] = len(group)


def _blur(recording: Recording, distance: float) -> float:
    """Return by how many pixels the noise of one step moves boxes at a distance [m]."""
    variance = np.diagonal(recording.odometry.covariance, axis1=1, axis2=2)
    turn = np.median(variance[:, -1]) + np.median(variance[:, 0]) / distance**2
    return recording.camera.fx * float(np.sqrt(turn))


def _depth_error(towards: NDArray[np.float64], covariance: NDArray[np.float64]) -> float:
    """Return the relative standard deviation of a distance; infinite where it is unknown."""
    if not np.isfinite(covariance).all():
        return np.inf
    variance = float(towards @ covariance @ towards)
    return float(np.sqrt(max(variance, 0.0))) / float(towards @ towards)


def predict(
    scene: SceneMap, pose: int, objects: NDArray[np.int64], covariance: NDArray[np.float64]
) -> PredictedBoxes:
    """Return where objects are expected in the image of a pose, rows being those of ``objects``."""
    recording = scene.recording
    return predict_boxes(
        recording.camera,
        recording.odometry.pose_model,
        scene.poses[pose],
        scene.ellipsoids[objects],
        covariance,
    )


def choose(
    scene: SceneMap,
    rows: NDArray[np.int64],
    objects: NDArray[np.int64],
    predicted: PredictedBoxes,
    bonus: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Assign the boxes of one image: the object of each (b,), -1 for none, and how sure (b,).

    A box costs ``bonus`` more with another object than that of its tracklet.
    """
    detections = scene.recording.detections
    shown = objects[predicted.object_row]
    costs = pair_costs(
        scene.recording.camera,
        predicted,
        detections.box[rows],
        scene.box_covariance[rows],
        detections.truncated[rows],
        scene.class_probability(rows, shown),
    )
    own = np.array([scene.object_of_tracklet.get(int(t), -1) for t in scene.tracklet[rows]])
    claimed = (own[:, None] >= 0) | np.isinf(bonus)
    stranger = claimed & (own[:, None] != shown)
    column, margin = assign(np.where(stranger, costs.cost + bonus, costs.cost), costs.null)
    return np.where(column >= 0, np.append(shown, -1)[column], -1), margin
