"""A simulated street: parked cars, and cars that come, go ahead, cross and leave.

Boxes are those of the corners of cuboids, by a projection that shares no code with the package.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator, default_rng

import dqslam as dq
from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.tracks.motion import VEHICLE
from dqslam.tracks.sizes import COMMON_SIGMA, OWN_SIGMA

CAMERA = dq.Camera(720.0, 720.0, 620.0, 187.0, 1242, 375)
KINDS = ("oncoming", "following", "crossing", "leaving", "parked")
IMAGES, SECONDS, SPEED, HEIGHT = 40, 0.1, 8.0, 1.6
NOISE = dq.BoxNoise(1.0, 0.01)
# Odometry errs by this in a step, meters and radians.
STEP = (0.005, 0.0003)
PARKED = 10
_CAR = (4.3, 1.8, 1.5)
_SUBSTEPS = 10


@dataclass(frozen=True, eq=False)
class Street:
    """A drive of 4 s, one thing that may move, parked cars, and the truth."""

    recording: dq.Recording
    """The thing's boxes have id 0, those of parked cars others; ids are true."""
    path: Floats
    """As the odometry has it, world_from_camera, shape (n, 7)."""
    path_covariance: Floats
    """Of small motions of all its poses, each in its own frame, shape (6 n, 6 n)."""
    ellipsoids: Floats
    """Of the parked cars, around their cuboids, shape (p, 9); car i has the id i + 1."""
    centers: Floats
    """Of the thing, in the world of ``true_path``, shape (n, 3)."""
    headings: Floats
    """Shape (n,)."""
    speeds: Floats
    """Shape (n,)."""
    true_path: Floats
    """world_from_camera, shape (n, 7)."""


def make_street(kind: str, seed: int) -> Street:
    """Simulate a street with one thing of a kind."""
    random = default_rng(seed)
    path = _path()
    half = _half_sides(random)
    places, headings, speeds = _drive(kind, random)
    lift = np.array([0.0, 0.0, 0.05 * random.normal()])
    centers = places + lift + [0.0, 0.0, half[2]]
    boxes, seen, cut = _boxes(path, centers, headings, half, random)
    rows = [(np.flatnonzero(seen), boxes[seen], cut[seen], np.zeros(seen.sum(), dtype=np.int64))]
    ellipsoids = []
    for number in range(1, PARKED + 1):
        side = random.choice([-1.0, 1.0])
        foot = [random.uniform(8.0, 70.0), side * random.uniform(5.5, 8.0), 0.05 * random.normal()]
        own = _half_sides(random)
        center = np.tile(np.add(foot, [0.0, 0.0, own[2]]), (IMAGES, 1))
        heading = np.full(IMAGES, 0.05 * random.normal())
        boxes, seen, cut = _boxes(path, center, heading, own, random)
        count = int(seen.sum())
        rows.append((np.flatnonzero(seen), boxes[seen], cut[seen], np.full(count, number)))
        ellipsoids.append(_core.ellipsoid_from_axes(center[0], own * 1.2, [0.0, 0.0, 0.0, 1.0]))
    pose, box, truncated, ids = (np.concatenate(column) for column in zip(*rows, strict=True))
    steps = _core.between(dq.PoseModel.SE3, path[:-1], path[1:])
    sigma = np.repeat(STEP, 3)
    noisy = _core.plus(dq.PoseModel.SE3, steps, sigma * random.normal(size=(len(steps), 6)))
    covariance = np.tile(np.diag(sigma**2), (len(steps), 1, 1))
    odometry = dq.Odometry(dq.PoseModel.SE3, path[0], noisy, covariance)
    count = len(pose)
    detections = dq.Detections(
        pose, box, np.ones(count), np.zeros(count, dtype=int), ids, {0: "car"}, truncated
    )
    times = np.asarray(SECONDS * np.arange(IMAGES), dtype=np.float64)
    reckoned = _core.dead_reckon(dq.PoseModel.SE3, path[0], noisy)
    return Street(
        dq.Recording(CAMERA, times, odometry, detections),
        reckoned,
        _chain_covariance(reckoned, sigma**2),
        np.array(ellipsoids),
        centers,
        headings,
        speeds,
        path,
    )


def _path() -> Floats:
    """Return the poses of a camera that looks ahead along x, (n, 7)."""
    poses = np.zeros((IMAGES, 7))
    poses[:, 0], poses[:, 2] = SPEED * SECONDS * np.arange(IMAGES), HEIGHT
    poses[:, 3:] = [-0.5, 0.5, -0.5, 0.5]
    return poses


def _half_sides(random: Generator) -> Floats:
    logs = COMMON_SIGMA * random.normal() + OWN_SIGMA * random.normal(size=3)
    return np.asarray(0.5 * np.array(_CAR) * np.exp(logs))


def _drive(kind: str, random: Generator) -> tuple[Floats, Floats, Floats]:
    """Return the places on the ground (n, 3), headings and speeds (n,) of a thing of a kind."""
    count, dt = IMAGES * _SUBSTEPS, SECONDS / _SUBSTEPS
    x, y, heading, speed, starts = {
        "oncoming": (random.uniform(60.0, 90.0), 3.5, np.pi, random.uniform(8.0, 14.0), 0.0),
        "following": (random.uniform(12.0, 25.0), 0.0, 0.0, random.uniform(6.0, 10.0), 0.0),
        "crossing": (random.uniform(40.0, 55.0), -14.0, np.pi / 2, random.uniform(5.0, 9.0), 0.0),
        "leaving": (random.uniform(40.0, 55.0), -3.5, 0.0, 0.0, random.uniform(1.3, 2.2)),
        "parked": (random.uniform(40.0, 60.0), -3.5, 0.0, 0.0, np.inf),
    }[kind]
    turn, state = 0.0, np.zeros((count, 4))
    for row in range(count):
        state[row] = x, y, heading, speed
        if row * dt < starts:
            continue
        x, y = x + dt * speed * np.cos(heading), y + dt * speed * np.sin(heading)
        heading += dt * turn
        speed += np.sqrt(dt) * VEHICLE.acceleration * random.normal()
        speed += dt * 2.0 * (kind == "leaving")
        turn += np.sqrt(dt) * VEHICLE.turn * random.normal()
    shown = state[::_SUBSTEPS]
    return np.column_stack([shown[:, :2], np.zeros(IMAGES)]), shown[:, 2], shown[:, 3]


def _boxes(
    path: Floats, centers: Floats, headings: Floats, half: Floats, random: Generator
) -> tuple[Floats, Bools, Bools]:
    """Return noisy boxes (n, 4), which images show them, (n,), and edges that are cut, (n, 4)."""
    boxes, seen = np.full((IMAGES, 4), np.nan), np.zeros(IMAGES, dtype=np.bool_)
    last = np.array([CAMERA.width, CAMERA.height]) - 0.5
    for row in range(IMAGES):
        points = []
        for corner in np.ndindex(2, 2, 2):
            arm = (2 * np.array(corner) - 1) * half
            c, s = np.cos(headings[row]), np.sin(headings[row])
            point = centers[row] + [c * arm[0] - s * arm[1], s * arm[0] + c * arm[1], arm[2]]
            ahead, left, up = point - path[row, :3]
            points.append((-left, -up, ahead))
        right, down, depth = np.array(points).T
        if (depth < 0.5).any():
            continue
        u = CAMERA.cx + CAMERA.fx * right / depth
        v = CAMERA.cy + CAMERA.fy * down / depth
        box = np.array([u.min(), v.min(), u.max(), v.max()])
        sigma = np.hypot(NOISE.pixels, NOISE.relative * np.tile(box[2:] - box[:2], 2))
        box += sigma * random.normal(size=4)
        boxes[row] = np.clip(box, -0.5, np.tile(last, 2))
        seen[row] = (boxes[row, 2:] - boxes[row, :2] > 4.0).all()
    return boxes, seen, np.isclose(boxes, [-0.5, -0.5, *last])


def _chain_covariance(path: Floats, variance: Floats) -> Floats:
    """Return the joint covariance of dead-reckoned poses (n, 7) with the same noise in each step.

    A small motion at a step moves all later poses: at pose j by the adjoint of j_from_i.
    """
    count, se3 = len(path), dq.PoseModel.SE3
    change = np.zeros((6 * count, 6 * count))
    for step in range(1, count):
        later = np.arange(step, count)
        back = _core.between(se3, path[later], np.tile(path[step], (len(later), 1)))
        columns = slice(6 * step, 6 * step + 6)
        change[6 * step :, columns] = np.concatenate(list(_core.adjoint(se3, back)))
    return np.asarray((change * np.tile(variance, count)) @ change.T)


def images_of(street: Street, ids: Ints) -> Ints:
    """Return the images that show some ids, ascending."""
    detections = street.recording.detections
    return np.unique(detections.pose[np.isin(detections.object_id, ids)])
