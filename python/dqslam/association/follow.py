"""Association along the path: predict, assign what is clear, start new objects, estimate, go on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObservationRow, Tracklet
from dqslam._limits import LARGEST_VARIANCE
from dqslam.association.assignment import assign
from dqslam.association.consistency import find_misfits, join_duplicates
from dqslam.association.gating import CHI2_GATE, PredictedBoxes, in_image, pair_costs, predict_boxes
from dqslam.association.initiation import MIN_VIEWS, propose_groups
from dqslam.association.scene_map import SceneMap
from dqslam.recording import Recording

# A box waits unless its choice is better than all others by this: -2 ln of the odds, 20 to 1.
MIN_MARGIN_AHEAD = 6.0
# A tracklet that does not fit its object in so many images in a row has gone over to another.
MISFITS_TO_CUT_TRACKLET = 3
# A path is followed in at most so many parts, an estimate each, of at least so many poses.
MAX_PARTS = 60
MIN_POSES_PER_PART = 3
# The level of the odometry's noise is estimated from so many poses on, after every third part:
# fewer residuals determine little, and an estimate of the level costs as much as one of the path.
MIN_POSES_FOR_NOISE = 10
PARTS_PER_NOISE_ESTIMATE = 3
# Iterations of the estimate after each part: the next part goes on from there.
MAX_ITERATIONS_PER_PART = 12
# A group of boxes starts an object if one place explains this share of them ...
INITIATION_MIN_FIT = 0.6
# ... and its distance is known: relative standard deviation.
INITIATION_MAX_DEPTH_ERROR = 0.3
# A group that was refused is tried again once it has grown by this factor.
INITIATION_RETRY_GROWTH = 1.25


class Follower:
    """Follows a path, and keeps what went wrong on the way."""

    def __init__(self, *, trust: float) -> None:
        """``trust`` is the probability that a tracklet stays with its object, 1 if that is sure."""
        self.final = trust == 1.0
        self.switch_cost = np.inf if self.final else 2.0 * float(np.log(trust / (1.0 - trust)))
        """What a box costs more with another object than that of its tracklet: -2 ln of odds."""
        self._misfits: dict[Tracklet, int] = {}  # images in a row
        self._refused: dict[tuple[ObservationRow, ...], int] = {}  # sizes, by their first boxes

    def follow(self, scene: SceneMap, progress: Callable[[float], None]) -> None:
        """Go along the whole path; ``progress`` is called with the share that is done."""
        end = len(scene.recording.timestamps)
        size = max(MIN_POSES_PER_PART, -(-end // MAX_PARTS))
        for part, begin in enumerate(range(1, end, size)):
            self.assign_ahead(scene, begin, min(begin + size, end))
            self.initiate_objects(scene)
            scene.estimate(max_iterations=MAX_ITERATIONS_PER_PART)
            if len(scene.poses) >= MIN_POSES_FOR_NOISE and part % PARTS_PER_NOISE_ESTIMATE == 0:
                scene.estimate_noise()
            if not self.final:
                join_duplicates(scene)
            scene.labels.dropped = find_misfits(scene)
            progress(len(scene.poses) / end)

    def assign_ahead(
        self, scene: SceneMap, begin: int, end: int, *, strangers_only: bool = False
    ) -> None:
        """Go on by odometry to some poses, and give their boxes to the objects they clearly show.

        What is known of the path and the objects is that of the pose before ``begin``. Strangers
        are boxes that wait and whose tracklets have no object.
        """
        scene.extend(end)
        known, covariance = scene.joint_covariance(begin - 1, _in_view(scene, begin, end))
        odometry = scene.recording.odometry
        k = odometry.covariance.shape[1]
        back = _core.inverse(odometry.pose_model, odometry.relative[begin - 1 : end - 1])
        moves = _core.adjoint(odometry.pose_model, back)
        for pose, moved in zip(range(begin, end), moves, strict=True):
            covariance[:k] = moved @ covariance[:k]
            covariance[:, :k] = covariance[:, :k] @ moved.T
            covariance[:k, :k] += odometry.covariance[pose - 1]
            self._assign(scene, pose, known, covariance, strangers_only=strangers_only)

    def _assign(
        self, scene: SceneMap, pose: int, known: Ints, covariance: Floats, *, strangers_only: bool
    ) -> None:
        """Give the boxes of a pose to some objects, whose covariance is joint with the pose's."""
        labels = scene.labels
        rows = np.flatnonzero(scene.recording.detections.pose == pose)
        predicted = predict(scene, pose, known, covariance)
        if strangers_only:
            predicted = predicted.without(np.isin(known, labels.object_rows[rows]))
            rows = rows[labels.are_strangers(rows)]
        if not rows.size or not len(predicted.box):
            return
        choice, margin = choose(scene, rows, known, predicted, self.switch_cost)
        for row, chosen, sure in zip(rows, choice, margin, strict=True):
            tracklet = labels.tracklets[row]
            own = labels.object_of_tracklet[tracklet]
            if own >= 0 and own != chosen:
                if not self.final:
                    self._count_misfit(scene, tracklet, pose)
            elif chosen >= 0 and (own >= 0 or sure >= MIN_MARGIN_AHEAD):
                labels.assign(np.array([row]), np.array([chosen]))
                labels.object_of_tracklet[tracklet] = chosen
                self._misfits[tracklet] = 0

    def _count_misfit(self, scene: SceneMap, tracklet: Tracklet, pose: int) -> None:
        """Count that a tracklet does not fit its object at a pose; in the end, cut it in two."""
        self._misfits[tracklet] = self._misfits.get(tracklet, 0) + 1
        if self._misfits[tracklet] >= MISFITS_TO_CUT_TRACKLET:
            late = scene.recording.detections.pose >= pose
            scene.labels.cut_tracklet(np.flatnonzero(late & (scene.labels.tracklets == tracklet)))

    def initiate_objects(self, scene: SceneMap) -> None:
        """Start the objects that waiting boxes agree on."""
        recording, labels = scene.recording, scene.labels
        seen = np.flatnonzero(recording.detections.pose < len(scene.poses))
        waiting = seen[labels.are_strangers(seen)]
        if not waiting.size:
            return
        cameras = _core.world_from_camera(
            recording.odometry.pose_model, recording.camera, scene.poses
        )
        proposed = propose_groups(
            recording, cameras, waiting, labels.tracklets, tracklets_only=self.final
        )
        names = [tuple(scene.observation_rows[group[:3]].tolist()) for group in proposed]
        groups = {
            name: group
            for name, group in zip(names, proposed, strict=True)
            if len(group) > INITIATION_RETRY_GROWTH * self._refused.get(name, 0)
        }
        if not groups:
            return
        ellipsoids, spread = scene.fit_groups(list(groups.values()))
        for (name, group), ellipsoid, covariance in zip(
            groups.items(), ellipsoids, spread, strict=True
        ):
            middle = cameras[recording.detections.pose[group], :3].mean(axis=0)
            towards = ellipsoid[:3] - middle
            blur = _blur(recording, float(np.linalg.norm(towards)))
            chi2 = scene.chi2(group, np.repeat(ellipsoid[None], len(group), axis=0), blur=blur)
            fits = chi2 <= CHI2_GATE[4]
            sure = _depth_error(towards, covariance) < INITIATION_MAX_DEPTH_ERROR
            if sure and fits.sum() >= MIN_VIEWS and fits.mean() >= INITIATION_MIN_FIT:
                scene.add_object(ellipsoid, group[fits])
            else:
                self._refused[name] = len(group)


def _in_view(scene: SceneMap, begin: int, end: int) -> Ints:
    """Return the objects that some of the poses should see; no other is predicted."""
    known = np.flatnonzero(scene.labels.box_counts > 0)
    camera, model = scene.recording.camera, scene.recording.odometry.pose_model
    shown = np.zeros(len(known), dtype=bool)
    for pose in scene.poses[begin:end]:
        shown |= in_image(camera, model, pose, scene.ellipsoids[known])
    return known[shown]


def _blur(recording: Recording, distance: float) -> float:
    """Return by how many pixels the noise of one step moves boxes at a distance [m]."""
    variance = np.diagonal(recording.odometry.covariance, axis1=1, axis2=2)
    turn = np.median(variance[:, -1]) + np.median(variance[:, 0]) / distance**2
    return recording.camera.fx * float(np.sqrt(turn))


def _depth_error(towards: Floats, covariance: Floats) -> float:
    """Return the relative standard deviation of a distance; infinite where it is unknown."""
    if not np.all(np.abs(covariance) <= LARGEST_VARIANCE):
        return np.inf
    variance = float(towards @ covariance @ towards)
    return float(np.sqrt(max(variance, 0.0))) / float(towards @ towards)


def predict(scene: SceneMap, pose: int, object_rows: Ints, covariance: Floats) -> PredictedBoxes:
    """Return where objects are expected in the image of a pose, by places in ``object_rows``."""
    recording = scene.recording
    return predict_boxes(
        recording.camera,
        recording.odometry.pose_model,
        scene.poses[pose],
        scene.ellipsoids[object_rows],
        covariance,
    )


def choose(
    scene: SceneMap, rows: Ints, object_rows: Ints, predicted: PredictedBoxes, switch_cost: float
) -> tuple[Ints, Floats]:
    """Assign the boxes of one image: the object of each (b,), -1 for none, and how sure (b,).

    A box costs ``switch_cost`` more with another object than that of its tracklet.
    """
    detections, labels = scene.recording.detections, scene.labels
    shown = object_rows[predicted.object_row]
    costs = pair_costs(
        scene.recording.camera,
        predicted,
        detections.box[rows],
        scene.box_covariance[rows],
        scene.cut_edges[rows],
        labels.class_probability(rows, shown),
    )
    cost = costs.cost - 2 * labels.look_odds(rows, shown)
    own = labels.object_of_tracklet[labels.tracklets[rows]]
    may_switch = (own[:, None] < 0) & np.isfinite(switch_cost)
    stranger = ~may_switch & (own[:, None] != shown)
    column, margin = assign(np.where(stranger, cost + switch_cost, cost), costs.null)
    return np.where(column >= 0, np.append(shown, -1)[column], -1), margin
