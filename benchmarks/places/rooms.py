"""Simulated rooms: objects of several classes, the map that a visit made, images of a later one.

The model of the boxes is stated here, and nothing of it is told to the package: boxes of ellipsoids
with an error of 1.5 px and of 4 % of the side on each edge, an object at a time; detection by
apparent size; 5 % wrong labels; 0.7 boxes an image that show nothing; nothing behind a nearer
object. ``benchmarks.places.worlds`` has other places and other detectors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam.io import BoxTable, MapObjects, Results
from dqslam.lens import cut_edges
from dqslam.places.visibility import view_objects
from dqslam.recording import Detections

CAMERA = _core.Camera(520.0, 520.0, 319.5, 239.5, 640, 480)
RATE_WIDTH_PX = 4.0
HIDDEN, LEAST_IN_IMAGE = 0.6, 0.4
CENTER_SIGMA_M, LOG_SIGMA = 0.02, 0.05


@dataclass(frozen=True)
class Detector:
    """What boxes an image has."""

    pixels: float = 1.5
    relative: float = 0.04
    """Of the side of a box."""
    best_rate: float = 0.85
    half_rate_px: float = 16.0
    confusion: float = 0.05
    false_boxes: float = 0.7
    farthest_m: float = 8.0
    cuboids: bool = False
    """The boxes are those of cuboids of the semi-axes, and no ellipsoid fits them from all sides.
    """


USUAL = Detector()


@dataclass(frozen=True, eq=False)
class Room:
    """Objects at their places."""

    extent: float
    """Side of the floor, meters."""
    class_names: tuple[str, ...]
    """Of all classes."""
    class_id: np.ndarray
    """Of each object, shape (o,)."""
    semi_axes: np.ndarray
    """Meters, shape (o, 3)."""
    turns: np.ndarray
    """Quaternions world_from_object, shape (o, 4)."""
    centers: np.ndarray
    """Meters, shape (o, 3)."""

    @property
    def ellipsoids(self) -> np.ndarray:
        """Shape (o, 9)."""
        rows = zip(self.centers, self.semi_axes, self.turns, strict=True)
        return np.array([_core.ellipsoid_from_axes(*row) for row in rows]).reshape(-1, 9)

    def select(self, rows: np.ndarray) -> Room:
        """Return the room with some of its objects."""
        return replace(
            self,
            class_id=self.class_id[rows],
            semi_axes=self.semi_axes[rows],
            turns=self.turns[rows],
            centers=self.centers[rows],
        )


def draw_room(random: np.random.Generator) -> Room:
    """Draw a room of 4 to 10 m with 8 to 60 objects of 3 to 12 classes."""
    extent, count = random.uniform(4.0, 10.0), int(random.integers(8, 61))
    classes = int(random.integers(3, 13))
    usual = np.exp(random.normal(np.log(0.12), 0.5, (classes, 3)))
    return furnish(extent, usual, random.integers(0, classes, count), random)


def draw_objects(room: Room, count: int, random: np.random.Generator) -> Room:
    """Draw other objects of the classes of a room."""
    rows = random.integers(0, len(room.class_id), count)
    usual = room.semi_axes[[np.flatnonzero(room.class_id == c)[0] for c in room.class_id[rows]]]
    drawn = furnish(room.extent, usual, np.arange(count), random)
    return replace(drawn, class_names=room.class_names, class_id=room.class_id[rows])


def furnish(
    extent: float, usual: np.ndarray, class_id: np.ndarray, random: np.random.Generator
) -> Room:
    """Draw objects of classes with usual semi-axes (c, 3) anywhere on a floor."""
    from scipy.spatial.transform import Rotation

    count = len(class_id)
    axes = usual[class_id] * np.exp(random.normal(0.0, 0.1, (count, 3)))
    places = np.column_stack(
        [random.uniform(-0.5, 0.5, (count, 2)) * extent, random.uniform(0.2, 1.6, count)]
    )
    names = tuple(f"class {number}" for number in range(len(usual)))
    turns = np.reshape(Rotation.random(count, random_state=random).as_quat(), (-1, 4))
    order = np.argsort(-axes, axis=1)
    return Room(extent, names, class_id, np.take_along_axis(axes, order, 1), turns, places)


def draw_poses(room: Room, count: int, random: np.random.Generator) -> np.ndarray:
    """Draw poses of a camera that looks at objects, nearly level; world_from_camera, (n, 7)."""
    from scipy.spatial.transform import Rotation

    poses = np.zeros((count, 7))
    for pose in poses:
        pose[:2] = random.uniform(-0.6, 0.6, 2) * room.extent
        pose[2] = random.uniform(1.0, 1.8)
        aim = room.centers[random.integers(len(room.centers))] + random.normal(0.0, 0.3, 3)
        z = (aim - pose[:3]) / np.linalg.norm(aim - pose[:3])
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= max(np.linalg.norm(x), 1e-9)
        level = Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
        pose[3:] = (level * Rotation.from_euler("z", random.normal(0.0, 0.07))).as_quat()
    return poses


@dataclass(frozen=True, eq=False)
class Seen:
    """Boxes of images, and the row of the object that each shows, -1 for none."""

    pose: np.ndarray
    box: np.ndarray
    class_id: np.ndarray
    object_row: np.ndarray


def box_cuboids(poses: np.ndarray, room: Room) -> np.ndarray:
    """Return the boxes (m, 4) of cuboids at poses (m, 7), by their corners before the camera.

    The half-sides are 0.9 of the semi-axes.
    """
    from scipy.spatial.transform import Rotation

    signs = np.array(np.meshgrid(*[[-0.9, 0.9]] * 3)).reshape(3, 8).T
    turn = Rotation.from_quat(room.turns).as_matrix()
    corners = room.centers[:, None] + (signs * room.semi_axes[:, None]) @ turn.transpose(0, 2, 1)
    world = Rotation.from_quat(poses[:, 3:]).as_matrix()
    inside = (corners - poses[:, None, :3]) @ world
    depth = np.maximum(inside[..., 2:], 0.05)
    at = inside[..., :2] / depth * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy]
    return np.hstack([at.min(axis=1), at.max(axis=1)])


def draw_boxes(
    room: Room, poses: np.ndarray, random: np.random.Generator, detector: Detector = USUAL
) -> Seen:
    """Draw the boxes of images at poses (n, 7)."""
    views = view_objects(CAMERA, poses, room.ellipsoids)
    size = views.size - detector.half_rate_px
    rate = detector.best_rate / (1.0 + np.exp(-size / RATE_WIDTH_PX))
    seen = (views.in_image > LEAST_IN_IMAGE) & (views.covered < HIDDEN)
    seen &= (views.distance < detector.farthest_m) & (random.random(rate.shape) < rate)
    pose, row = np.nonzero(seen)
    box = views.box[pose, row]
    if detector.cuboids:
        box = box_cuboids(poses[pose], room.select(row))
    side = np.tile(box[:, 2:] - box[:, :2], (1, 2))
    box = box + random.normal(0.0, detector.pixels, box.shape)
    box += random.normal(0.0, detector.relative, box.shape) * side
    false = random.poisson(detector.false_boxes, len(poses))
    middle = random.uniform([0, 0], [CAMERA.width, CAMERA.height], (false.sum(), 2))
    half = np.exp(random.uniform(np.log(6.0), np.log(100.0), (false.sum(), 2)))
    box = np.vstack([box, np.hstack([middle - half, middle + half])])
    pose = np.concatenate([pose, np.repeat(np.arange(len(poses)), false)])
    row = np.concatenate([row, np.full(false.sum(), -1)])
    any_class = random.integers(0, len(room.class_names), len(row))
    wrong = (row < 0) | (random.random(len(row)) < detector.confusion)
    class_id = np.where(wrong, any_class, np.append(room.class_id, 0)[row])
    last = np.array([CAMERA.width - 0.5, CAMERA.height - 0.5])
    box = np.hstack([np.clip(box[:, :2], -0.5, last), np.clip(box[:, 2:], -0.5, last)])
    keep = np.flatnonzero((box[:, 2:] - box[:, :2] > 3.0).all(axis=1))
    keep = keep[np.argsort(pose[keep], kind="stable")]
    return Seen(pose[keep], box[keep], class_id[keep], row[keep])


def map_room(
    room: Room,
    images: int,
    random: np.random.Generator,
    detector: Detector = USUAL,
    *,
    everything: bool = False,
) -> Results:
    """Make the map of a visit of so many images; see ``map_with_rows``."""
    return map_with_rows(room, images, random, detector, everything=everything)[0]


def map_with_rows(
    room: Room,
    images: int,
    random: np.random.Generator,
    detector: Detector = USUAL,
    *,
    everything: bool = False,
) -> tuple[Results, np.ndarray]:
    """Make the map of a visit of so many images: objects with errors, all boxes with the object.

    Objects with less than 3 boxes are not mapped, unless ``everything`` is. Also return the row in
    the room of each object of the map.
    """
    poses = draw_poses(room, images, random)
    seen = draw_boxes(room, poses, random, detector)
    counts = np.bincount(seen.object_row[seen.object_row >= 0], minlength=len(room.class_id))
    known = np.flatnonzero((counts >= 3) | everything)
    mapped = room.select(known)
    centers = mapped.centers + random.normal(0.0, CENTER_SIGMA_M, mapped.centers.shape)
    axes = mapped.semi_axes * np.exp(random.normal(0.0, LOG_SIGMA, mapped.semi_axes.shape))
    row_of = np.full(len(room.class_id) + 1, -1)
    row_of[known] = np.arange(len(known))
    unknown = np.full((len(known), 9), np.nan)
    objects = MapObjects(
        object_ids=np.arange(len(known)),
        class_names=tuple(room.class_names[number] for number in mapped.class_id),
        centers=centers,
        semi_axes=axes,
        orientations=mapped.turns,
        dual_quadrics=unknown,
        observations=counts[known],
        center_covariances=np.tile(CENTER_SIGMA_M**2 * np.eye(3), (len(known), 1, 1)),
        log_semi_axes_sigmas=np.full((len(known), 3), LOG_SIGMA),
    )
    boxes = BoxTable(
        pose=seen.pose,
        box=seen.box,
        truncated=cut_edges(CAMERA, seen.box),
        score=np.ones(len(seen.box)),
        class_id=seen.class_id,
        class_name=tuple(room.class_names[number] for number in seen.class_id),
        object_id=row_of[seen.object_row],
        inlier=row_of[seen.object_row] >= 0,
        held_out=np.zeros(len(seen.box), dtype=bool),
    )
    results = Results(
        directory=Path("room"),
        camera=CAMERA,
        timestamps=np.arange(float(images)),
        poses=poses,
        initial_poses=poses,
        covariances=np.full((images, 6, 6), np.nan),
        objects=objects,
        boxes=boxes,
        report={},
    )
    return results, known


def detections_of(room: Room, seen: Seen) -> Detections:
    """Return boxes as a recording has them, without the objects that they show."""
    return Detections(
        pose=seen.pose,
        box=seen.box,
        score=np.ones(len(seen.box)),
        class_id=seen.class_id,
        object_id=np.full(len(seen.box), -1),
        class_names=dict(enumerate(room.class_names)),
    )


def change_room(room: Room, share: float, random: np.random.Generator) -> Room:
    """Take away, move or add objects: that share of the objects each third."""
    rows = random.permutation(len(room.class_id))
    changed = max(1, round(share * len(rows)))
    kinds = np.array_split(rows[:changed], 3)
    centers = room.centers.copy()
    centers[kinds[0]] += random.normal(0.0, 1.0, (len(kinds[0]), 3)) * [1.0, 1.0, 0.2]
    moved = replace(room, centers=centers).select(np.setdiff1d(np.arange(len(rows)), kinds[1]))
    return join(moved, draw_objects(room, len(kinds[2]), random))


def join(room: Room, more: Room) -> Room:
    """Return the objects of both."""
    return replace(
        room,
        class_id=np.concatenate([room.class_id, more.class_id]),
        semi_axes=np.concatenate([room.semi_axes, more.semi_axes]),
        turns=np.concatenate([room.turns, more.turns]),
        centers=np.concatenate([room.centers, more.centers]),
    )
