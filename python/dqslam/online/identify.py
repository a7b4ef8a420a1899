"""Which objects the boxes of a session show, where they have no ids or ids that may be wrong.

The association of whole recordings, step by step: boxes are linked to tracklets, keyframes are
chosen, and at each of them the boxes are given to the objects that they clearly show, by the joint
covariance that the last keyframes leave; others wait, in the session too, until an object starts
from them. ``SceneMap`` and ``Follower`` do this here as they do there, on a part of the path.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.association import FINAL
from dqslam.association.appearance import directions, learn_appearance
from dqslam.association.consistency import (
    find_misfits,
    find_movers,
    find_scattered,
    join_duplicates,
)
from dqslam.association.follow import MIN_POSES_FOR_NOISE, Follower
from dqslam.association.keyframes import KeyframeChooser
from dqslam.association.rays import rays_of_boxes
from dqslam.association.refine import assign_afterwards
from dqslam.association.tracklets import Linker
from dqslam.online.commit import commit
from dqslam.online.inputs import CheckedBoxes
from dqslam.online.integrated_odometry import IntegratedOdometry
from dqslam.online.keyframes import Keyframe
from dqslam.online.local_map import LocalMap, local_map
from dqslam.online.look_back import LookBackBudget
from dqslam.online.state import State

# When the boxes of a keyframe have found their objects, the poses of so many are minimized ...
SMOOTHED_KEYFRAMES = 10
# ... by so many iterations: the next keyframe goes on from there.
SMOOTHING_ITERATIONS = 2
# The boxes of a keyframe are assigned again when there are so many newer ones: more is known then.
KEYFRAMES_UNTIL_REASSIGNED = 10
# Duplicates, sizes, movers and noise are looked at each time there are so many new keyframes, one
# of them at each keyframe ...
KEYFRAMES_PER_JUDGMENT = 5
# ... and one object, whether it moved: that takes two estimates of the window.
SUSPECTS_AT_A_TIME = 1
# An object is out of view after so many keyframes without a box: it is asked whether it moved.
KEYFRAMES_UNTIL_DEPARTED = 3


class Identifier:
    """Follows a session, keyframe by keyframe."""

    def __init__(self, state: State) -> None:
        """Begin without a box."""
        self._state = state
        self._linker = Linker(state.settings.camera)
        self._chooser = KeyframeChooser()
        self._budget = LookBackBudget()
        self._follower = Follower(trust=state.settings.trust)
        self._misfits: set[ObjectRow] = set()
        self._judgments: list[Callable[[LocalMap], None]] = []  # one at each of the next keyframes
        self._judged_keyframes = 0  # how many there were when departed objects were judged
        self._odometry = IntegratedOdometry.of_no_steps(state.settings.pose_model)
        self._path_end = self._odometry.relative  # by odometry, from where this began

    def integrate(self, relative: Floats, covariance: Floats) -> None:
        """Follow the odometry of a step, from the first keyframe on."""
        if self._state.store.keyframes:
            model = self._state.settings.pose_model
            self._odometry = self._odometry.then(model, relative, covariance)
            self._path_end = _core.compose(model, self._path_end[None], relative[None])[0]

    def identify(self, boxes: CheckedBoxes, rows: Ints, observation_rows: Ints) -> Ints:
        """Return the object that each of some boxes of the last step shows, -1 for none, (b,)."""
        settings, store = self._state.settings, self._state.store
        pose = len(self._state.timestamps) - 1
        some = boxes.select(rows)
        seen_from = _core.world_from_camera(
            settings.pose_model, settings.camera, self._path_end[None]
        )
        class_ids = store.class_ids(some.class_name)
        looks = directions(some.embedding)
        tracklets = self._linker.link(
            pose, seen_from[0], some.box, class_ids[:, None], some.object_id, looks
        )
        store.add_image(pose, rows, tracklets, free_tracklet=self._linker.started)
        rays = rays_of_boxes(settings.camera, np.repeat(seen_from, len(rows), axis=0), some.box)
        if not self._chooser.choose(tracklets, rays):
            return store.labels.object_of_tracklet[tracklets]
        keyframe = Keyframe(pose, self._state.timestamps[-1], self._odometry, some)
        self._odometry = IntegratedOdometry.of_no_steps(settings.pose_model)
        store.add_keyframe(keyframe, observation_rows, tracklets)
        if len(store.keyframes) > 1:
            self._identify_keyframe()
        return store.labels.object_rows[-len(rows) :]

    def _identify_keyframe(self) -> None:
        """Find the objects of the last keyframe's boxes, start new ones, and judge some."""
        state, store = self._state, self._state.store
        local = local_map(state, self._budget.next_window(len(store.keyframes)))
        self._assign(local)
        begin = self._budget.for_strangers(local, store)
        self._commit(local)
        looks_back = begin < local.begin
        if looks_back:
            local = local_map(state, begin)
            self._assign(local, strangers_only=True)
            self._commit(local)
        first_pose = store.keyframes[-SMOOTHED_KEYFRAMES:][0].pose
        state.core.smooth(SMOOTHING_ITERATIONS, begin=first_pose)
        local.scene.poses = state.core.poses_at(
            [one.pose for one in store.keyframes[local.begin :]]
        )
        local.scene.ellipsoids = state.core.ellipsoids
        self._follower.initiate_objects(local.scene)
        self._reassign_older(local)
        self._commit(local)
        if len(store.keyframes) % KEYFRAMES_PER_JUDGMENT == 0 and not self._judgments:
            self._judgments = [self._join, self._judge_sizes, self._judge_noise]
        if self._judgments and not looks_back:  # which is work enough
            self._judgments.pop(0)(local)

    def _assign(self, local: LocalMap, *, strangers_only: bool = False) -> None:
        """Give boxes of the last keyframe to objects, its pose being that of odometry."""
        scene = local.scene
        last = len(scene.poses) - 1
        scene.poses = scene.poses[:last]
        self._follower.assign_ahead(scene, last, last + 1, strangers_only=strangers_only)
        before, now = local.base.tracklets[local.first_box :], scene.labels.tracklets
        for row in np.flatnonzero(now != before).tolist():  # tracks go on under their new numbers
            self._linker.cut(before[row], now[row])
        self._linker.started = len(scene.labels.object_of_tracklet)

    def _commit(self, local: LocalMap) -> None:
        commit(self._state, local)
        local.base = self._state.store.snapshot()

    def _reassign_older(self, local: LocalMap) -> None:
        """Assign the boxes of an older keyframe: more is known now."""
        scene, labels = local.scene, local.scene.labels
        pose = len(scene.poses) - 1 - KEYFRAMES_UNTIL_REASSIGNED
        rows = np.flatnonzero(scene.recording.detections.pose == pose)
        if not rows.size:
            return
        found = assign_afterwards(
            scene, pose, rows, labels.shown_objects, self._follower.switch_cost
        )
        labels.release(rows)
        labels.assign(rows, found)
        tracklets, own = labels.tracklets[rows], labels.object_of_tracklet
        own[tracklets] = np.where(own[tracklets] < 0, found, own[tracklets])

    def _join(self, local: LocalMap) -> None:
        """Join objects that are one, looking back if one of them was seen long ago."""
        if self._state.settings.trust == FINAL:
            return
        local.scene.learn_size(local.scene.labels.shown_objects)
        begin = self._budget.for_duplicates(local, self._state.store)
        if begin < local.begin:
            local = local_map(self._state, begin)
        join_duplicates(local.scene)
        self._commit(local)

    def _judge_sizes(self, local: LocalMap) -> None:
        """Leave out objects of unusual size; those that have departed are asked whether they moved.

        Sizes are looked at again; what has moved has moved.
        """
        labels = local.scene.labels
        local.scene.learn_size(labels.shown_objects)
        stays = {row: why for row, why in labels.dropped.items() if row not in self._misfits}
        misfits = find_misfits(local.scene)
        self._misfits = set(misfits)
        labels.dropped = misfits | stays
        self._commit(local)
        departed = [row for row in labels.shown_objects.tolist() if self._has_departed(row)]
        self._judged_keyframes = len(self._state.store.keyframes)
        for first in range(0, len(departed), SUSPECTS_AT_A_TIME):
            some = departed[first : first + SUSPECTS_AT_A_TIME]
            self._judgments.append(partial(self._judge_motion, some))

    def _judge_motion(self, suspects: list[ObjectRow], local: LocalMap) -> None:
        """Leave out those of some objects that have moved, or whose ids name several things."""
        scene, labels = local.scene, local.scene.labels
        labels.dropped = labels.dropped | find_movers(scene, suspects)
        if self._state.settings.trust == FINAL:
            scattered = find_scattered(scene)
            labels.dropped |= {row: scattered[row] for row in suspects if row in scattered}
        self._commit(local)

    def _judge_noise(self, local: LocalMap) -> None:
        """Correct the level of the odometry's noise, and learn what looks say."""
        scene = local.scene
        if len(scene.poses) >= MIN_POSES_FOR_NOISE:
            scene.estimate_noise()
            self._commit(local)
        appearance, _ = learn_appearance(scene.recording.detections)
        if appearance is not None:
            self._linker.appearance = appearance
            self._state.store.labels.appearance = appearance

    def _has_departed(self, row: ObjectRow) -> bool:
        """Return whether an object has gone out of view since such objects were judged."""
        store = self._state.store
        seen = store.keyframes_of(row)
        if not len(seen):
            return False
        first = int(seen[-1]) + KEYFRAMES_UNTIL_DEPARTED  # the keyframe at which it counts as gone
        return self._judged_keyframes <= first < len(store.keyframes)
