"""Which objects the boxes of a session show, where they have no ids or ids that may be wrong.

The association of whole recordings, step by step: boxes are linked to tracklets, keyframes are
chosen, and at each of them the boxes are given to the objects that they clearly show, by the joint
covariance that the last keyframes leave; others wait, in the session too, until an object starts
from them. ``SceneMap`` and ``Follower`` do this here as they do there, on a part of the path.
"""

from __future__ import annotations

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
# Noise, sizes, duplicates and movers are looked at each time there are so many new keyframes.
KEYFRAMES_PER_JUDGMENT = 5
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
        """Find the objects of the last keyframe's boxes, start new ones, and judge all."""
        state, store = self._state, self._state.store
        local = local_map(state, self._budget.next_window(len(store.keyframes)))
        self._assign(local)
        begin = self._budget.for_strangers(local, store)
        self._commit(local)
        if begin < local.begin:
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
        if len(store.keyframes) % KEYFRAMES_PER_JUDGMENT == 0:
            begin = self._budget.for_duplicates(local, store)
            if begin < local.begin:
                self._commit(local)
                local = local_map(state, begin)
            self._judge(local)
        self._commit(local)

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

    def _judge(self, local: LocalMap) -> None:
        """Look at the level of the noise, and at objects that are one, or move."""
        scene, labels = local.scene, local.scene.labels
        near = labels.shown_objects
        scene.learn_size(near)
        final = self._state.settings.trust == FINAL
        if not final:
            join_duplicates(scene)
        # Sizes are looked at again; what has moved has moved.
        stays = {row: why for row, why in labels.left_out.items() if row not in self._misfits}
        misfits = find_misfits(scene)
        self._misfits = set(misfits)
        labels.left_out = misfits | stays
        departed = [row for row in near.tolist() if self._has_departed(row)]
        labels.left_out |= find_movers(scene, departed)
        if final:
            scattered = find_scattered(scene)
            labels.left_out |= {row: scattered[row] for row in departed if row in scattered}
        if len(scene.poses) >= MIN_POSES_FOR_NOISE:
            scene.estimate_noise()
        appearance, _ = learn_appearance(scene.recording.detections)
        if appearance is not None:
            self._linker.appearance = appearance
            self._state.store.labels.appearance = appearance

    def _has_departed(self, row: ObjectRow) -> bool:
        """Return whether an object has gone out of view since the last judgment."""
        store = self._state.store
        seen = store.keyframes_of(row)
        absent = len(store.keyframes) - 1 - seen[-1] if len(seen) else 0
        first = KEYFRAMES_UNTIL_DEPARTED
        return bool(first <= absent < first + KEYFRAMES_PER_JUDGMENT)
