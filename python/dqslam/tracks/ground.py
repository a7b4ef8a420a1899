"""The ground that things move on, as far as the cameras and what they saw show it.

A robot's camera stays at one height above the ground, and turned to it in one way: the ground is a
plane in its frame, uphill, downhill and where a drifting path is tilted. A camera in the hand does
not: then the ground is level in the world. Of the two, that one is taken on which things stand with
less scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.metrics.upright import up_direction

# The ground is known by so many lower ends of things at least.
FEWEST_FEET = 3
# Things that stand on the ground are off it by this at least [m]: curbs, and errors of boxes.
LEAST_SIGMA_M = 0.05
# Away from the camera, the ground falls or rises by this share of the distance at least, ...
LEAST_SLOPE = 0.005
# ... and a camera is turned to it as it is to the direction up on average, with this sigma [rad].
# If it moves in one direction of its own, as a vehicle does, it moves along the ground.
TURNED_SIGMA, TURNED_SIGMA_OF_VEHICLE = 0.05, 0.01
# The mean of unit vectors of the motion over so far [m] is at least so long then, and so much of it
# is across the camera's x axis.
_SPAN_M, _ONE_DIRECTION, _ACROSS = 2.0, 0.95, 0.5
# Without a ground, the foot is anywhere within this height [m].
UNKNOWN_SIGMA_M = 100.0
_ROUNDS = 10

GroundKind = Literal["below the camera", "level", "unknown"]


@dataclass(frozen=True, eq=False)
class Ground:
    """A plane below the camera or in the world, in a frame whose third axis is up."""

    world_from_ground: Floats
    """Rotation about the world's origin, shape (3, 3)."""
    kind: GroundKind
    normal: Floats
    """Unit normal in the frame of the camera, or of the ground where that is level, shape (3,)."""
    height_m: float
    """Of the camera above the ground, or of a level ground in its frame, meters."""
    sigma_m: float
    """Of the height at which a thing stands near the camera, each by itself, meters."""
    slope_sigma: float
    """What that grows by with the distance from the camera, as a share of it."""
    common_sigma_m: float
    """Of the height of the ground near the camera, the same for all things, meters."""
    tilt: Floats
    """Covariance of that height [m] with the slopes of the ground along the axes of the camera, or
    of the ground where that is level, shape (4, 4): the three slopes first."""
    feet: int
    """How many lower ends of things have shown it."""

    def planes(self, rotation: Floats, position: Floats) -> Floats:
        """Return the ground c + a x + b y as cameras see it, rows of c, a, b; shape (n, 3).

        ``rotation`` (n, 3, 3) and ``position`` (n, 3) are those of the cameras in the ground's
        frame.
        """
        if self.kind != "below the camera":
            return np.tile([self.height_m, 0.0, 0.0], (len(position), 1))
        normal = rotation @ self.normal
        slope = -normal[:, :2] / normal[:, 2:]
        beneath = position[:, 2] - self.height_m / normal[:, 2]
        return np.column_stack([beneath - np.sum(slope * position[:, :2], axis=1), slope])

    def sigmas(self, toward: Floats) -> Floats:
        """Return the sigmas [m] of the height of the foot of a thing, (n,).

        ``toward`` (n, 3) is where it is in the frame of the camera, meters.
        """
        place = np.column_stack([toward, np.ones(len(toward))])
        common = np.einsum("ni,ij,nj->n", place, self.tilt, place)
        return np.asarray(np.sqrt(self._own(np.linalg.norm(toward, axis=1)) ** 2 + common))

    def corrected(self, above: Floats, variance: Floats, distance: Floats) -> Ground:
        """Return the ground as corrected by heights [m] at which things stand above it, (t,).

        ``variance`` [m^2] is that of what these things say by themselves, without the ground, and
        ``distance`` [m] that from the camera, both of shape (t,).
        """
        weight = 1.0 / (variance + self._own(distance) ** 2)
        total = self.common_sigma_m**-2 + weight.sum()
        rise = float(weight @ above / total)
        way = -1.0 if self.kind == "below the camera" else 1.0
        known = self._of_height_sigma(float(total**-0.5))
        return replace(known, height_m=self.height_m + way * rise)

    def of_unknown_height(self) -> Ground:
        """Return a ground of the same shape whose height is unknown."""
        return self._of_height_sigma(UNKNOWN_SIGMA_M)

    def _of_height_sigma(self, sigma: float) -> Ground:
        scale = np.array([1.0, 1.0, 1.0, sigma / self.common_sigma_m])
        tilt = scale[:, None] * self.tilt * scale
        return replace(self, common_sigma_m=sigma, tilt=tilt)

    def _own(self, distance: Floats) -> Floats:
        return np.asarray(np.hypot(self.sigma_m, self.slope_sigma * distance))


@dataclass(frozen=True, eq=False)
class Feet:
    """Where things stand, as images show them: one row for a thing in an image."""

    thing: Ints
    """Number of the thing, shape (f,)."""
    image: Ints
    """Row of the pose, shape (f,)."""
    place: Floats
    """In the world, meters, shape (f, 3)."""
    sigma: Floats
    """Of its height, by the boxes of the thing, meters, shape (f,)."""


def find_ground(cameras: Floats, feet: Feet) -> Ground:
    """Find the ground from camera poses world_from_camera (n, 7) and where things stand."""
    from scipy.spatial.transform import Rotation

    up = up_direction(cameras)
    axis = np.eye(3)[int(np.argmin(np.abs(up)))]
    east = np.cross(axis, up) / np.linalg.norm(np.cross(axis, up))
    turn = np.column_stack([east, np.cross(up, east), up])
    count = len(np.unique(feet.thing))
    if count < FEWEST_FEET:
        height = float((cameras[:, :3] @ up).mean())
        sigmas = (LEAST_SIGMA_M, LEAST_SLOPE, UNKNOWN_SIGMA_M)
        tilt = np.diag([0.0, 0.0, 0.0, UNKNOWN_SIGMA_M**2])
        return Ground(turn, "unknown", np.eye(3)[2], height, *sigmas, tilt, count)
    axes = Rotation.from_quat(cameras[:, 3:]).as_matrix()
    toward = np.einsum("nji,nj->ni", axes[feet.image], feet.place - cameras[feet.image, :3])
    distance = np.linalg.norm(toward, axis=1)
    share = 1.0 / np.bincount(feet.thing)[feet.thing]
    normal, turned_sigma = _normal_in_camera(cameras, axes, up)
    normal, off_camera = _turned(normal, turned_sigma, toward, distance, share, feet.sigma)
    off_world = feet.place @ up
    choices: list[tuple[float, Ground]] = []
    kinds: tuple[tuple[GroundKind, float, Floats, Floats], ...] = (
        ("below the camera", -1.0, normal, off_camera),
        ("level", 1.0, np.eye(3)[2], off_world),
    )
    for kind, way, own, off in kinds:
        middle = _weighted_median(off, share / (LEAST_SIGMA_M**2 + feet.sigma**2))
        away = np.abs(off - middle)
        scatter = _weighted_median(away, share)
        sigma, slope = _spread(away, distance, share, feet.sigma)
        weight = share / (sigma**2 + (slope * distance) ** 2 + feet.sigma**2)
        tilt = np.zeros((4, 4))
        if kind == "below the camera":  # how it is turned is as unknown as how high it is
            columns, prior = _columns(normal, turned_sigma, toward)
            found = np.linalg.inv(columns.T @ (weight[:, None] * columns) + prior)
            by_found = np.zeros((4, 3))
            by_found[:3, :2], by_found[3, 2] = np.linalg.svd(normal[None])[2][1:].T, 1.0
            tilt = by_found @ found @ by_found.T
        else:
            tilt[3, 3] = 1.0 / weight.sum()
        # A median is less certain than a mean by pi / 2; of few feet, the spread is itself unsure.
        tilt *= 0.5 * np.pi * (1.0 + 3.0 / count)
        common = float(np.sqrt(tilt[3, 3]))
        ground = Ground(turn, kind, own, way * middle, sigma, slope, common, tilt, count)
        choices.append((scatter, ground))
    return min(choices, key=lambda one: one[0])[1]


def _normal_in_camera(cameras: Floats, axes: Floats, up: Floats) -> tuple[Floats, float]:
    """Return the normal of the ground in the camera's frame, (3,), and how sure it is [rad].

    A vehicle moves along the ground, and the x axis of its camera is level to it. Of other cameras
    the direction up is known, on average.
    """
    step = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(cameras[:, :3], axis=0), axis=1)))
    ends = np.searchsorted(step, step + _SPAN_M)
    starts = np.flatnonzero(ends < len(step))
    run = cameras[ends[starts], :3] - cameras[starts, :3]
    ahead = np.einsum("nji,nj->ni", axes[starts], run)
    ahead = (ahead / np.linalg.norm(ahead, axis=1, keepdims=True)).sum(axis=0) / max(len(run), 1)
    normal = np.cross(ahead, [1.0, 0.0, 0.0])
    mean_up = (up @ axes).mean(axis=0)
    if np.linalg.norm(ahead) > _ONE_DIRECTION and np.linalg.norm(normal) > _ACROSS:
        normal *= np.sign(normal @ mean_up)
        return normal / np.linalg.norm(normal), TURNED_SIGMA_OF_VEHICLE
    return mean_up / np.linalg.norm(mean_up), TURNED_SIGMA


def _columns(normal: Floats, turned_sigma: float, toward: Floats) -> tuple[Floats, Floats]:
    """Return how turns of a normal, about two axes, and a shift move feet (f, 3), and their prior.

    Shapes (f, 3) and (3, 3).
    """
    basis = np.linalg.svd(normal[None])[2][1:]
    columns = np.column_stack([toward @ basis.T, np.ones(len(toward))])
    return columns, np.diag([turned_sigma**-2, turned_sigma**-2, 0.0])


def _turned(
    normal: Floats,
    turned_sigma: float,
    toward: Floats,
    distance: Floats,
    share: Floats,
    own: Floats,
) -> tuple[Floats, Floats]:
    """Turn a normal in the camera's frame to where feet (f, 3) there are on one plane.

    Returns the normal and the coordinates of the feet along it [m], (f,). Feet count by their share
    and their sigmas, ``own`` [m] among them, and less the further they are off.
    """
    basis = np.linalg.svd(normal[None])[2][1:]
    columns, prior = _columns(normal, turned_sigma, toward)
    sigma = np.sqrt(LEAST_SIGMA_M**2 + (2.0 * LEAST_SLOPE * distance) ** 2 + own**2)
    weight, found = share / sigma**2, np.zeros(3)
    for _ in range(_ROUNDS):
        right = -columns.T @ (weight * (toward @ normal))
        found = np.linalg.solve(columns.T @ (weight[:, None] * columns) + prior, right)
        off = (toward @ normal + columns @ found) / sigma
        weight = share / sigma**2 / (1.0 + (off / 3.0) ** 2)
    turned = normal + found[:2] @ basis
    turned /= np.linalg.norm(turned)
    return turned, toward @ turned


def _spread(away: Floats, distance: Floats, share: Floats, own: Floats) -> tuple[float, float]:
    """Return the sigma [m] near the camera and its growth, by how far feet are off [m], (f,).

    Half of the feet of a normal are off by less than 0.6745 sigma. The growth is that of the
    farther half of them. ``own`` [m] are the sigmas that explain a part of it, (f,).
    """
    far = distance > _weighted_median(distance, share)
    slope = LEAST_SLOPE
    if far.any():
        beyond = np.sqrt(np.maximum(away**2 - (0.6745 * own) ** 2, 0.0)) / distance
        slope = max(slope, _weighted_median(beyond[far], share[far]) / 0.6745)
    sigma = LEAST_SIGMA_M
    for _ in range(_ROUNDS):
        whole = np.sqrt(sigma**2 + (slope * distance) ** 2 + own**2)
        sigma *= max(_weighted_median(away / whole, share) / 0.6745, LEAST_SIGMA_M / sigma)
    return float(sigma), float(slope)


def _weighted_median(values: Floats, weight: Floats) -> float:
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])


def feet_of_ellipsoids(ellipsoids: Floats, up: Floats) -> Floats:
    """Return the lowest points of ellipsoids (o, 9) straight below their centers, shape (o, 3)."""
    shape = _core.ellipsoid_shapes(ellipsoids)
    reach = np.sqrt(np.einsum("i,nij,j->n", up, shape, up))
    return np.asarray(ellipsoids[:, :3] - reach[:, None] * up)


def feet_of_boxes(
    camera: _core.Camera, cameras: Floats, box: Floats, usable: Bools, height_m: Floats
) -> Floats:
    """Return where things of known heights (m,) stand by their boxes (m, 4) alone, (u, 3).

    ``usable`` (m,) flags those whose upper and lower edges are not cut, and ``cameras`` (m, 7) are
    world_from_camera.
    """
    rows: Ints = np.flatnonzero(usable)
    depth = camera.fy * height_m[rows] / (box[rows, 3] - box[rows, 1])
    points = np.zeros((len(rows), 7))
    points[:, 0] = depth * (0.5 * (box[rows, 0] + box[rows, 2]) - camera.cx) / camera.fx
    points[:, 1] = depth * (box[rows, 3] - camera.cy) / camera.fy
    points[:, 2], points[:, 6] = depth, 1.0
    return np.asarray(_core.compose(_core.PoseModel.SE3, cameras[rows], points)[:, :3])
