"""Filmed scenes: cameras, ellipsoids at rest or moving, and a detector that errs.

Boxes come from the outline of the projected dual quadric, in plain numpy: nothing is shared with
the package's projection.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from dqslam import Camera, Detections, Odometry, PoseModel, Recording, _core
from dqslam.association.labels import Labels
from dqslam.association.scene_map import SceneMap
from dqslam.assumptions import BoxNoise, OdometryNoise
from orbit import looking_at_origin

CAMERA = Camera(500.0, 510.0, 321.0, 239.0, 640, 480)
NAMES = {1: "cup", 2: "car", 3: "book"}


@dataclass
class Thing:
    """An ellipsoid."""

    center: np.ndarray
    """Meters, at the first pose, shape (3,)."""
    semi_axes: np.ndarray
    class_id: int = 1
    path: np.ndarray | None = None
    """Center at each pose (n, 3), of what moves."""
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))

    def at(self, pose):
        return self.center if self.path is None else self.path[pose]


@dataclass
class Film:
    """A recording without ids, and the truth."""

    recording: Recording
    poses: np.ndarray
    """world_from_camera, shape (n, 7)."""
    thing: np.ndarray
    """Which thing each box shows, -1 for a false positive, shape (m,)."""
    things: list[Thing]

    def with_ids(self, ids=None):
        """Return the recording with the true ids, or others (m,)."""
        ids = self.thing if ids is None else ids
        return replace(self.recording, detections=replace(self.recording.detections, object_id=ids))

    def ate(self, poses):
        """Return the root mean square distance of positions, first pose fixed, meters."""
        return float(np.sqrt(np.mean(np.sum((poses - self.poses)[:, :3] ** 2, axis=1))))

    @property
    def odometry(self):
        """Poses by odometry alone, shape (n, 7)."""
        odometry = self.recording.odometry
        return _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)

    @property
    def centers(self):
        return np.array([thing.center for thing in self.things])


def film(poses, things, *, noise=None, noise_px=1.0, missed=0.0, false_positives=0.0, seed=0):
    """Show things to a detector at poses (n, 7), world_from_camera.

    ``noise`` is that of a step of odometry, exact by default. A box is missed with the probability
    ``missed``; an image has ``false_positives`` boxes of nothing, on average.
    """
    random = np.random.default_rng(seed)
    rows = []
    for pose in range(len(poses)):
        for number, thing in enumerate(things):
            box = outline(poses[pose], thing.at(pose), thing.semi_axes, thing.turn)
            if box is not None and random.random() >= missed:
                rows.append((pose, box + random.normal(0.0, noise_px, 4), thing.class_id, number))
        for _ in range(random.poisson(false_positives)):
            corner = random.uniform([0.0, 0.0], [540.0, 380.0])
            box = np.concatenate([corner, corner + random.uniform(20.0, 100.0, 2)])
            rows.append((pose, box, int(random.choice([one.class_id for one in things])), -1))
    se3 = PoseModel.SE3
    relative = _core.between(se3, poses[:-1], poses[1:])
    believed = noise or OdometryNoise(1e-4, 1e-4)
    if noise is not None:
        sigma = np.repeat([noise.translation_m, noise.rotation_rad], 3)
        relative = _core.plus(se3, relative, random.normal(0.0, sigma, (len(relative), 6)))
    pose, box, class_id, thing = zip(*rows, strict=True)
    detections = Detections(
        pose=pose,
        box=box,
        score=np.ones(len(rows)),
        class_id=class_id,
        object_id=np.full(len(rows), -1),
        class_names=NAMES,
    )
    odometry = Odometry(se3, poses[0], relative, believed.covariance(len(relative)))
    recording = Recording(CAMERA, 0.1 * np.arange(len(poses)), odometry, detections)
    return Film(recording, poses, np.array(thing), things)


def outline(pose, center, semi_axes, turn):
    """Return the box of an ellipsoid seen from a pose (7,), None unless wholly in the image.

    Tangents of the dual conic at u = const. are (1, 0, -u): a quadratic equation.
    """
    conic = dual_conic(pose, center, semi_axes, turn)
    if conic is None:
        return None
    edges = np.empty(4)
    for axis in (0, 1):
        middle = conic[axis, 2]
        half = np.sqrt(middle**2 - conic[axis, axis])
        edges[axis], edges[axis + 2] = middle - half, middle + half
    inside = (edges[:2] > 4).all() and (edges[2:] < [CAMERA.width - 5, CAMERA.height - 5]).all()
    return edges if inside else None


def dual_conic(pose, center, semi_axes, turn):
    """Return the image (3, 3) of an ellipsoid from a pose (7,), None unless it is in front.

    The image of the dual quadric Q is the dual conic P Q P^T, here [c c^T - E, c; c^T, 1].
    """
    rotation = Rotation.from_quat(pose[3:]).as_matrix()
    seen = rotation.T @ (center - pose[:3])
    shape = rotation.T @ turn * semi_axes
    if seen[2] - np.linalg.norm(shape[2]) <= 0.1:
        return None
    k = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    conic = k @ (shape @ shape.T - np.outer(seen, seen)) @ k.T
    return conic / conic[2, 2]


def cut_by_the_border():
    """Return a recording of a pose with a perfect box of each of four objects, (4, 9), and these.

    They are 5 m away, ever further to the right: the border of the image cuts them, and the
    detector bounds what it sees. The highest point of the first is in the image, of no other.
    """
    border, semi_axes = CAMERA.width - 0.5, np.array([0.5, 0.3, 0.4])
    here = np.eye(7)[6]
    boxes, ellipsoids = [], []
    for x in (2.9, 3.2, 3.4, 3.6):
        turn = Rotation.from_euler("y", x)
        center = np.array([x, 0.2, 5.0])
        conic = dual_conic(here, center, semi_axes, turn.as_matrix())
        middle = conic[:2, 2]
        root = np.linalg.cholesky(np.outer(middle, middle) - conic[:2, :2])
        angle = np.linspace(0.0, 2.0 * np.pi, 200_000)
        points = middle + np.column_stack([np.cos(angle), np.sin(angle)]) @ root.T
        seen = points[points[:, 0] <= border]
        boxes.append([*seen.min(axis=0), border, seen[:, 1].max()])
        ellipsoids.append(_core.ellipsoid_from_axes(center, semi_axes, turn.as_quat()))
    detections = Detections(
        pose=np.zeros(4, dtype=int),
        box=np.array(boxes),
        score=np.ones(4),
        class_id=np.ones(4, dtype=int),
        object_id=np.arange(4),
        class_names=NAMES,
        truncated=np.tile([False, False, True, False], (4, 1)),
    )
    odometry = Odometry(PoseModel.SE3, here, np.zeros((0, 7)), np.zeros((0, 6, 6)))
    return Recording(CAMERA, np.zeros(1), odometry, detections), np.array(ellipsoids)


def map_truly(made, labels=None, *, step_noise=None, levels=None):
    """Return a map of a whole film: each thing with its boxes, or those of other labels (m,).

    Poses are the odometry's, objects are where their things are when they are first seen.
    """
    labels = made.thing if labels is None else labels
    recording = made.recording
    tracklets = np.where(labels < 0, labels.max() + 1, labels)
    scene = SceneMap(
        recording,
        Labels.of(recording.detections, tracklets),
        box_noise=BoxNoise(1.0, 0.0),
        step_noise=step_noise,
        levels=levels,
    )
    scene.extend(len(made.poses))
    for label in np.unique(labels[labels >= 0]):
        rows = np.flatnonzero(labels == label)
        thing = made.things[made.thing[rows[0]]]
        center = thing.at(recording.detections.pose[rows[0]])
        turn = Rotation.from_matrix(thing.turn).as_quat()
        scene.add_object(_core.ellipsoid_from_axes(center, thing.semi_axes, turn), rows)
    return scene


def orbit_poses(count=40, turns=1.0, distance=1.2):
    """Circle around the origin, looking at it; x-y is the table; (n, 7)."""
    angle = np.linspace(0.0, 2 * np.pi * turns, count, endpoint=False)
    around = [np.cos(angle), np.sin(angle), 0.6 + 0.15 * np.sin(3 * angle)]
    position = distance * np.column_stack(around)
    turns = [Rotation.from_matrix(looking_at_origin(point)).as_quat() for point in position]
    return np.hstack([position, turns])


def street_poses(count=60, step=1.0):
    """Drive straight ahead along z, x to the right, y down; (n, 7)."""
    poses = np.zeros((count, 7))
    poses[:, 2] = step * np.arange(count)
    poses[:, 6] = 1.0
    return poses


def table_things(count=8, seed=0):
    """Put cups and books of one size on a ring and in its middle: every other one is a cup."""
    random = np.random.default_rng(seed)
    things = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        radius = 0.35 if i % 2 else 0.18
        center = np.array([radius * np.cos(angle), radius * np.sin(angle), 0.02 * i])
        turn = Rotation.random(random_state=random).as_matrix()
        semi_axes = random.uniform(0.03, 0.06, 3)
        things.append(Thing(center, semi_axes, class_id=1 if i % 2 else 3, turn=turn))
    return things


def switched_ids(made):
    """Return the ids of a tracker that gives new ones every 15 images, and mixes two up, (m,)."""
    pose = made.recording.detections.pose
    ids = made.thing + 10 * (pose // 15)
    switched = ids.copy()
    switched[(pose >= 20) & (ids == 11)] = 13
    switched[(pose >= 20) & (ids == 13)] = 11
    assert np.any(switched != ids)
    return switched
