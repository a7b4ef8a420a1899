"""Which objects the boxes of a session show, where ids do not tell, or not for sure.

The association of whole recordings, step by step: boxes are linked to tracklets, keyframes are
chosen, and at each of them the boxes are given to the objects that they clearly show, by the joint
covariance that the last keyframes leave; others wait, in the session too, until an object is born
from them. ``SceneMap`` and ``Follower`` do this here as they do there, on a part of the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.association import FINAL
from dqslam.association.consistency import (
    find_misfits,
    find_movers,
    find_scattered,
    join_duplicates,
)
from dqslam.association.follow import FIRST_NOISE, Follower
from dqslam.association.keyframes import KeyframeChooser
from dqslam.association.rays import rays_of_boxes
from dqslam.association.refine import assign_afterwards
from dqslam.association.tracklets import Linker
from dqslam.online.integrated_odometry import Leg
from dqslam.online.keyframes import Journal, Keyframe
from dqslam.online.local_map import Assumptions, Part, cut_part
from dqslam.online.look_back import Reach
from dqslam.online.objects import Registry
from dqslam.online.refinement import Refinement
from dqslam.online.tell import tell

# Keyframes whose poses are minimized when the boxes of the last one have found their objects.
RECENT = 10
ITERATIONS = 2
# The boxes of a keyframe are assigned again when there are so many newer ones.
AGAIN = 10
# Keyframes between two looks at the level of the noise, at sizes and at duplicates.
JUDGE_EVERY = 5
# Keyframes without a box of an object, until it is asked whether it has moved.
DEPARTED = 3


@dataclass(frozen=True, eq=False)
class NewBoxes:
    """Boxes of the last step, whose objects are not known."""

    row: Ints
    """Of the boxes of the step, shape (b,)."""
    sight: Ints
    """Rows in the session, shape (b,)."""
    box: Floats
    truncated: Bools
    class_name: list[str]
    claim: Ints
    """Ids that a tracker gave, -1 for none."""


class Identifier:
    """Follows a session, keyframe by keyframe."""

    def __init__(self, assumptions: Assumptions, journal: Journal, *, trust: float) -> None:
        """``trust`` is the probability that an id stays with its object."""
        camera, pose_model = assumptions.camera, assumptions.pose_model
        self._assumptions = assumptions
        self._camera, self._pose_model = camera, pose_model
        self._journal = journal
        self._trust = trust
        self._linker = Linker(camera)
        self._chooser = KeyframeChooser()
        self._reach = Reach()
        self._follower: Follower | None = None
        self._misfits: set[int] = set()
        self._leg = Leg.of_no_steps(pose_model)
        self._path_end = self._leg.relative  # by odometry, from where this began

    @property
    def has_begun(self) -> bool:
        """Whether there have been boxes that no id told the objects of."""
        return bool(self._journal.keyframes)

    def polish(
        self, session: _core.Session, registry: Registry, options: _core.SolveOptions
    ) -> Refinement:
        """Make a polish of all keyframes."""
        part = self._part(session, 0)
        return Refinement(part, self._journal, registry, session, options, trust=self._trust)

    def go_on(self, relative: Floats, covariance: Floats) -> None:
        """Take a step without looking; not the first."""
        self._leg = self._leg.then(self._pose_model, relative, covariance)
        self._path_end = _core.compose(self._pose_model, self._path_end[None], relative[None])[0]

    def look(
        self, session: _core.Session, registry: Registry, timestamp: float, boxes: NewBoxes
    ) -> Ints:
        """Return the row of the object that each box of the last step shows, -1 for none; (b,)."""
        journal = self._journal
        pose = session.num_poses - 1
        seen_from = _core.world_from_camera(self._pose_model, self._camera, self._path_end[None])
        class_id = journal.class_ids(boxes.class_name)
        tracklet = self._linker.link(pose, seen_from[0], boxes.box, class_id, boxes.claim)
        journal.remember(pose, boxes.row, tracklet)
        rays = rays_of_boxes(self._camera, np.repeat(seen_from, len(boxes.box), axis=0), boxes.box)
        if not self._chooser.is_new(tracklet, rays):
            known = [journal.object_of_tracklet.get(number, -1) for number in tracklet.tolist()]
            return np.array(known, dtype=np.int64)
        frame = Keyframe(
            pose=pose,
            timestamp=timestamp,
            leg=self._leg,
            sight=boxes.sight,
            box=boxes.box,
            truncated=boxes.truncated,
            class_id=class_id,
            claim=boxes.claim,
            tracklet=tracklet,
            object=np.full(len(tracklet), -1),
        )
        self._leg = Leg.of_no_steps(self._pose_model)
        journal.add_keyframe(frame)
        if len(journal.keyframes) > 1:
            self._identify(session, registry)
        return frame.object

    def _identify(self, session: _core.Session, registry: Registry) -> None:
        """Find the objects of the last keyframe's boxes, and what else these tell."""
        part = self._part(session, self._reach.window(self._journal))
        self._assign(part)
        begin = self._reach.for_strangers(part, self._journal)
        self._tell(session, registry, part)
        if begin < part.begin:
            part = self._part(session, begin)
            self._assign(part, strangers_only=True)
            self._tell(session, registry, part)
        session.smooth(ITERATIONS, begin=self._journal.keyframes[-RECENT:][0].pose)
        self._refresh(session, part)
        self._follow(part).give_birth()
        self._assign_again(part)
        if len(self._journal.keyframes) % JUDGE_EVERY == 0:
            begin = self._reach.for_duplicates(part, self._journal)
            if begin < part.begin:
                self._tell(session, registry, part)
                part = self._part(session, begin)
            self._judge(part)
        self._tell(session, registry, part)

    def _assign(self, part: Part, *, strangers_only: bool = False) -> None:
        """Give boxes of the last keyframe to objects, its pose being that of odometry."""
        last = len(part.scene.poses) - 1
        part.scene.poses = part.scene.poses[:last]
        self._follow(part).assign_ahead(last, last + 1, strangers_only=strangers_only)
        self._cut_tracks(part)

    def _part(self, session: _core.Session, begin: int) -> Part:
        return cut_part(
            self._journal, self._assumptions, session, begin, free_tracklet=self._linker.started
        )

    def _follow(self, part: Part) -> Follower:
        if self._follower is None:
            self._follower = Follower(part.scene, trust=self._trust)
        self._follower.scene = part.scene
        return self._follower

    def _cut_tracks(self, part: Part) -> None:
        """Let tracks go on under the numbers that their tracklets have now."""
        now = part.scene.tracklet[-len(self._journal.keyframes[-1].tracklet) :]
        for before, number in zip(self._journal.keyframes[-1].tracklet, now, strict=True):
            if before != number:
                self._linker.cut(int(before), int(number))
        self._linker.started = part.scene.free_tracklet

    def _refresh(self, session: _core.Session, part: Part) -> None:
        frames = self._journal.keyframes[part.begin :]
        part.scene.poses = session.poses_at([frame.pose for frame in frames])
        part.scene.ellipsoids = session.ellipsoids

    def _tell(self, session: _core.Session, registry: Registry, part: Part) -> None:
        final = self._trust == FINAL
        tell(part, self._journal, registry, session, ids_are_final=final)

    def _assign_again(self, part: Part) -> None:
        """Assign the boxes of an older keyframe: more is known now."""
        scene = part.scene
        pose = len(scene.poses) - 1 - AGAIN
        rows = np.flatnonzero(scene.recording.detections.pose == pose)
        if not rows.size:
            return
        near = np.unique(scene.box_object[scene.box_object >= 0])
        found = assign_afterwards(scene, pose, rows, near, self._follower_bonus())
        scene.release(rows)
        scene.claim(rows, found)
        for row in rows[found >= 0].tolist():
            scene.object_of_tracklet.setdefault(
                int(scene.tracklet[row]), int(scene.box_object[row])
            )

    def _follower_bonus(self) -> float:
        assert self._follower is not None
        return self._follower.bonus

    def _judge(self, part: Part) -> None:
        """Look at the level of the noise, and at objects that are one, or move."""
        scene = part.scene
        near = np.unique(scene.box_object[scene.box_object >= 0])
        scene.learn_size(near)
        final = self._trust == FINAL
        if not final:
            join_duplicates(scene)
        # Sizes are looked at again; what has moved has moved.
        stays = {row: why for row, why in scene.left_out.items() if row not in self._misfits}
        misfits = find_misfits(scene)
        self._misfits = set(misfits)
        scene.left_out = misfits | stays
        departed = [number for number in near.tolist() if self._has_departed(number)]
        scene.left_out |= find_movers(scene, departed)
        if final:
            scattered = find_scattered(scene)
            scene.left_out |= {row: scattered[row] for row in departed if row in scattered}
        if len(scene.poses) >= FIRST_NOISE:
            scene.estimate_noise()

    def _has_departed(self, number: int) -> bool:
        """Tell whether an object has gone out of view since the last judgment."""
        seen = self._journal.keyframes_of(number)
        absent = len(self._journal.keyframes) - 1 - seen[-1] if seen else 0
        return DEPARTED <= absent < DEPARTED + JUDGE_EVERY
