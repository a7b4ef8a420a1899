"""Tracklets: boxes of one object in successive images, linked by where they are in the image.

A tracklet ends where there is doubt: joining two later, in space, is easier than cutting one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam._ids import Tracklet
from dqslam.association.appearance import CLEARLY_DIFFERENT, Appearance, directions
from dqslam.association.images import group_by_pose
from dqslam.association.labels import class_shares
from dqslam.association.rays import cameras_by_odometry, points_at_depth_one
from dqslam.metrics import box_iou
from dqslam.recording import Recording

# A box overlaps the place predicted for it by at least this, as intersection over union ...
MIN_OVERLAP = 0.3
# ... or its middle is so many box sides away at most, with nothing else of its class twice as far
# around, and it is by this factor larger or smaller at most.
MAX_SIDES_AWAY = 1.0
MAX_GROWTH = 1.6
# A track that is not seen again within so many images is lost: its prediction is worth nothing.
MAX_IMAGES_UNSEEN = 5
# A box may be of another class than the likeliest if that has this probability.
MIN_CLASS_SHARE = 0.2


@dataclass
class _Track:
    """What is known of a tracklet when the next image comes."""

    number: Tracklet
    classes: Ints
    """Classes that the last box may be of, shape (k,)."""
    tracker_id: int
    """Id that a tracker gave, -1 for none."""
    pose: int
    camera: Floats
    """world_from_camera of that pose by odometry, shape (7,)."""
    box: Floats
    looks: Floats
    """Mean of what its boxes look like, shape (e,)."""
    drift: Floats = field(default_factory=lambda: np.zeros(2))
    """Motion of the center per image beside what the camera's turning explains, in pixels."""
    boxes: int = 1

    def follow(self, new: _Track, predicted: Floats) -> None:
        """Go on with a box, that of a new track, and learn from where it was predicted."""
        off = _centers(new.box) - _centers(predicted)
        self.drift = self.drift + 0.5 * off / (new.pose - self.pose)
        self.pose, self.camera, self.box, self.classes = new.pose, new.camera, new.box, new.classes
        self.boxes += 1
        self.looks = self.looks + (new.looks - self.looks) / self.boxes


class Linker:
    """Links the boxes of one image after the other.

    The box of a track is predicted by the turn of the camera, which odometry knows well, and the
    steady motion of the box beside it. Pairs of least distance are chosen over the whole image.
    """

    def __init__(self, camera: _core.Camera) -> None:
        """Begin without tracks."""
        self._camera = camera
        self._tracks: list[_Track] = []
        self._of_id: dict[int, Tracklet] = {}
        self.started = 0
        """Numbers below this are taken."""
        self.appearance: Appearance | None = None
        """What looks say; None where they say nothing."""

    def link(
        self,
        pose: int,
        camera: Floats,
        box: Floats,
        classes: Ints,
        tracker_ids: Ints,
        looks: Floats,
    ) -> Ints:
        """Return the number of the tracklet of each box of an image, shape (b,).

        Parameters
        ----------
        pose
            Row of the pose, above those before.
        camera
            world_from_camera by odometry, shape (7,).
        box
            Shape (b, 4).
        classes
            Classes that each box may be of, the likeliest first, shape (b, k). It goes on a track
            of the same class, or of another one of them if there is no other choice.
        tracker_ids
            Ids (b,) that a tracker gave, -1 for none: all boxes of an id are one tracklet.
        looks
            What each box looks like, unit vectors (b, e).
        """
        self._tracks = [track for track in self._tracks if pose - track.pose <= MAX_IMAGES_UNSEEN]
        tracklet = np.full(len(box), -1, dtype=np.int64)
        predicted = _predict(self._tracks, pose, camera, self._camera)
        named, allowed = self._may_go_on(classes, tracker_ids, looks)
        new = [
            _Track(Tracklet(-1), classes[j], tracker_id, pose, camera, box[j], looks[j])
            for j, tracker_id in enumerate(tracker_ids.tolist())
        ]
        for i, j in _match(predicted, box, named, allowed):
            self._tracks[i].follow(new[j], predicted[i])
            tracklet[j] = self._tracks[i].number
        for j in np.flatnonzero(tracklet < 0).tolist():
            tracker_id = new[j].tracker_id
            number = self._of_id.get(tracker_id)
            if number is None:
                number = Tracklet(self.started)
                self.started += 1
            if tracker_id >= 0:
                self._of_id[tracker_id] = number
            new[j].number = tracklet[j] = number
            self._tracks.append(new[j])
        return tracklet

    def _may_go_on(self, classes: Ints, tracker_ids: Ints, looks: Floats) -> tuple[Bools, Bools]:
        """Return which boxes (b,) of the same class may go on which tracks, (t, b), and of any."""
        if not self._tracks:
            none = np.zeros((0, len(classes)), dtype=np.bool_)
            return none, none
        own_ids = np.array([track.tracker_id for track in self._tracks])
        own = np.array([track.classes for track in self._tracks])
        allowed = own_ids[:, None] == tracker_ids
        if self.appearance is not None:
            similarity = np.array([track.looks for track in self._tracks]) @ looks.T
            allowed &= self.appearance.log_odds(similarity) >= CLEARLY_DIFFERENT
        named = allowed & (own[:, None, 0] == classes[:, 0])
        if classes.shape[1] == 1:
            return named, named
        return named, allowed & (own[:, None, :, None] == classes[:, None]).any(axis=(2, 3))

    def cut(self, tracklet: Tracklet, number: Tracklet) -> None:
        """Go on with a tracklet under another number."""
        for track in self._tracks:
            if track.number == tracklet:
                track.number = number
        for tracker_id, own in self._of_id.items():
            if own == tracklet:
                self._of_id[tracker_id] = number


def link_tracklets(
    recording: Recording,
    *,
    tracker_ids: Ints | None = None,
    appearance: Appearance | None = None,
) -> Ints:
    """Return the number of the tracklet of each box, shape (m,), in order of their first boxes.

    ``tracker_ids`` (m,) are those that a tracker gave, -1 for none: all boxes of an id are one
    tracklet. ``appearance`` tells what the vectors of boxes say, by default nothing.
    """
    detections = recording.detections
    cameras = cameras_by_odometry(recording)
    ids = np.full(len(detections), -1) if tracker_ids is None else tracker_ids
    tracklet = np.full(len(detections), -1, dtype=np.int64)
    linker = Linker(recording.camera)
    linker.appearance = appearance
    looks = directions(detections.embedding)
    possible, shares = class_shares(detections)
    classes = np.where(shares >= MIN_CLASS_SHARE, possible, possible[:, :1])
    for pose, rows in group_by_pose(detections.pose):
        tracklet[rows] = linker.link(
            pose, cameras[pose], detections.box[rows], classes[rows], ids[rows], looks[rows]
        )
    return np.asarray(np.unique(tracklet, return_inverse=True)[1])


def _centers(box: Floats) -> Floats:
    return 0.5 * (box[..., :2] + box[..., 2:])


def _predict(tracks: list[_Track], pose: int, seen_from: Floats, camera: _core.Camera) -> Floats:
    """Return where the boxes of tracks are expected in the image of a pose, shape (t, 4)."""
    if not tracks:
        return np.zeros((0, 4))
    box = np.array([track.box for track in tracks])
    last = np.array([track.pose for track in tracks])
    drift = np.array([track.drift for track in tracks])
    turns = np.array([track.camera for track in tracks])
    turns[:, :3] = 0.0
    here = np.repeat(seen_from[None], len(box), axis=0)
    here[:, :3] = 0.0
    se3 = _core.PoseModel.SE3
    far = _core.compose(se3, turns, points_at_depth_one(camera, _centers(box)))
    seen = _core.between(se3, here, far)[:, :3]
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    expected = middle + focal * seen[:, :2] / seen[:, 2:].clip(min=0.1)
    shift = expected - _centers(box) + drift * (pose - last)[:, None]
    return np.asarray(box + np.tile(shift, (1, 2)))


def _match(predicted: Floats, box: Floats, named: Bools, allowed: Bools) -> list[tuple[int, int]]:
    """Pair tracks (t, 4) with boxes (b, 4): by overlap where ``named`` (t, b), then the rest.

    The rest are pairs that are ``allowed`` (t, b), where neither has another choice around.
    """
    from scipy.optimize import linear_sum_assignment

    if not len(predicted) or not len(box):
        return []
    overlap = np.where(named, box_iou(predicted[:, None], box), 0.0)
    rows, columns = linear_sum_assignment(-overlap)
    pairs = [
        (i, j)
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        if overlap[i, j] >= MIN_OVERLAP
    ]
    return pairs + _only_choices(pairs, predicted, box, allowed)


def _only_choices(
    pairs: list[tuple[int, int]], predicted: Floats, box: Floats, allowed: Bools
) -> list[tuple[int, int]]:
    """Pair what is left where neither has another choice around."""
    if len(pairs) == min(len(predicted), len(box)):
        return []
    size, new_size = predicted[:, 2:] - predicted[:, :2], box[:, 2:] - box[:, :2]
    offset = np.linalg.norm(_centers(predicted)[:, None] - _centers(box), axis=2)
    distance = np.where(allowed, offset / np.sqrt(size.prod(axis=1))[:, None], np.inf)
    growth = np.abs(np.log(size[:, None] / new_size)).max(axis=2)
    near = distance < 2 * MAX_SIDES_AWAY
    fits = (distance < MAX_SIDES_AWAY) & (growth < np.log(MAX_GROWTH))
    alone = (near.sum(axis=1) == 1)[:, None] & (near.sum(axis=0) == 1)
    tracks_taken, boxes_taken = {i for i, _ in pairs}, {j for _, j in pairs}
    return [
        (i, j)
        for i, j in np.argwhere(fits & alone).tolist()
        if i not in tracks_taken and j not in boxes_taken
    ]
