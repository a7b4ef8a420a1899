"""Seeded problems of any size: a paper-like area, and chains of such areas.

An area is a loop of 20 x 12.5 m, driven twice in steps of 0.25 m with the camera looking inside,
and ellipsoids of radii 0.5, 0.4, 0.3 m within. Areas follow each other along x, 20 m apart: loops
are closed within an area, as many as one likes. All objects are seen whole or not at all.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator, default_rng

from dqslam import (
    BoxNoise,
    Camera,
    Detections,
    Odometry,
    Recording,
    SizePrior,
    Truth,
    _core,
    load_scenario,
    simulate,
)
from dqslam._checks import Bools, Floats, Ints
from dqslam._core import PoseModel

_STEP_M = 0.25
_SIDES_M = (20.0, 12.5, 20.0, 12.5)
_GAP_M = 20.0
_RADII_M = np.array([0.5, 0.4, 0.3])
_APART_M = 1.6  # of two objects' centers on the ground, at least
_DEPTH_M = (1.0, 25.0)  # at which a center is seen
_CAMERA_HEIGHT_M = 1.0
_SIGMA_M, _LATERAL_SIGMA_M = 0.02, 0.005
_SIGMA_RAD, _TURN_SIGMA_RAD = 0.02, 0.1
_START_SIGMA_M = 0.3  # of the centers that peers start from
BOX_SIGMA_PX = 1.0
# What all programs and sessions assume, so that they have the same problem.
NOISE = BoxNoise(pixels=BOX_SIGMA_PX, relative=0.0)
SIZES = SizePrior()


@dataclass(frozen=True, eq=False)
class Problem:
    """What every program is given, and the answer."""

    recording: Recording
    """Boxes have a noise of BOX_SIGMA_PX."""
    truth: Truth
    peer_centers: Floats
    """Where peers start the objects that have boxes, ids ascending, meters, shape (o, 3).

    They have no start of their own: each gets the true center relative to the first pose that saw
    it, in the frame of the dead-reckoned one, with a noise of 0.3 m. Kinder than what dqslam has.
    """


def paper(seed: int, noise: float) -> Problem:
    """Simulate the drive of the paper's experiment, ellipsoids, boxes only."""
    scenario = load_scenario("paper").model_copy(update={"objects": "ellipsoids"})
    settings = scenario.odometry
    sigmas = {name: noise * value for name, value in settings if name.endswith("sigma_m")}
    sigmas |= {name: noise * value for name, value in settings if name.endswith("sigma_rad")}
    sigmas.pop("lateral_sigma_m", None)  # assumed only, never drawn
    scenario = scenario.model_copy(update={"odometry": settings.model_copy(update=sigmas)})
    recording, truth = simulate(scenario, seed=seed)
    recording = replace(recording, positions=None)
    return Problem(recording, truth, _near_centers(recording, truth, default_rng(seed)))


def chain(areas: int, objects: int, seed: int, noise: float) -> Problem:
    """Drive through a chain of areas.

    The draws come in the order in which `docs/benchmarks.md` lists them: with seed 0, the worlds
    of the figures that were published for these sizes.

    Parameters
    ----------
    areas, objects
        How many areas, and objects in each: 520 areas + 80 (areas - 1) + 1 poses.
    noise
        Factor on the noise of odometry.
    """
    random = default_rng(seed)
    steps, area_of_pose = _drive(areas)
    center, yaw = _objects(areas, objects, random)
    is_turn = steps[:, 2] != 0.0
    sigma = np.column_stack(
        [
            np.full(len(steps), noise * _SIGMA_M),
            np.full(len(steps), _LATERAL_SIGMA_M),
            noise * np.where(is_turn, _TURN_SIGMA_RAD, _SIGMA_RAD),
        ]
    )
    measured = steps.copy()
    for axis in (0, 2):  # (v, omega) never errs sideways
        measured[:, axis] += sigma[:, axis] * random.normal(size=len(steps))

    truth = _truth(_core.dead_reckon(PoseModel.SE2, np.zeros(3), steps), center, yaw)
    camera = _camera()
    pose, row, box = _exact_boxes(camera, truth, area_of_pose, objects)
    recording = Recording(
        camera=camera,
        timestamps=np.arange(len(truth.poses), dtype=np.float64),
        odometry=Odometry(PoseModel.SE2, np.zeros(3), measured, _covariance(measured, sigma)),
        detections=Detections(
            pose=pose,
            box=box + BOX_SIGMA_PX * random.normal(size=box.shape),
            score=np.ones(len(box)),
            class_id=np.zeros(len(box), dtype=np.int64),
            object_id=row,
            class_names={0: "ellipsoid"},
        ),
    )
    return Problem(recording, truth, _near_centers(recording, truth, random))


def _drive(areas: int) -> tuple[Floats, Ints]:
    """Return the true steps (v, 0, omega), shape (n - 1, 3), and the area of each pose, (n,)."""
    lap = []
    for side in _SIDES_M:
        straight = round(side / _STEP_M) - 1
        lap += [0.0] * straight + [np.pi / 2.0]
    transit = [0.0] * round(_GAP_M / _STEP_M)
    turns = np.concatenate([lap * 2 + transit] * (areas - 1) + [lap * 2])
    steps = np.column_stack([np.full(len(turns), _STEP_M), np.zeros(len(turns)), turns])
    area = np.minimum(np.arange(len(turns) + 1) // (2 * len(lap) + len(transit)), areas - 1)
    return steps, area


def _objects(areas: int, count: int, random: Generator) -> tuple[Floats, Floats]:
    """Return centers, meters, shape (o, 3), and headings, radians, shape (o,)."""
    center, yaw = [], []
    low, high = np.array([2.5, 3.0, 0.6]), np.array([17.5, 9.5, 1.6])
    for area in range(areas):
        placed: list[Floats] = []
        while len(placed) < count:
            one = random.uniform(low, high) + [area * _GAP_M, 0.0, 0.0]
            if all(np.hypot(*(one - other)[:2]) > _APART_M for other in placed):
                placed.append(one)
        center += placed
        yaw.append(random.uniform(0.0, np.pi / 2.0, size=count))
    return np.array(center), np.concatenate(yaw)


def _covariance(measured: Floats, sigma: Floats) -> Floats:
    """Turn variances along the axes of the previous pose into those of the next, (n - 1, 3, 3)."""
    turn = measured[:, 2]
    next_from_previous = np.tile(np.eye(3), (len(turn), 1, 1))
    next_from_previous[:, 0, 0] = next_from_previous[:, 1, 1] = np.cos(turn)
    next_from_previous[:, 0, 1] = np.sin(turn)
    next_from_previous[:, 1, 0] = -np.sin(turn)
    scaled = next_from_previous * sigma[:, None, :]
    return np.asarray(scaled @ scaled.transpose(0, 2, 1))


def _camera() -> Camera:
    """Return a camera that looks to the left of the robot: 1500 px, 1280 x 1024."""
    left = [0.0, 0.0, _CAMERA_HEIGHT_M, -np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    return Camera(1500.0, 1500.0, 639.5, 511.5, 1280, 1024, robot_from_camera=left)


def _truth(poses: Floats, center: Floats, yaw: Floats) -> Truth:
    turned = np.column_stack([np.zeros((len(yaw), 2)), np.sin(yaw / 2.0), np.cos(yaw / 2.0)])
    rows = zip(center, turned, strict=True)
    return Truth(
        pose_model=PoseModel.SE2,
        poses=poses,
        object_ids=np.arange(len(center)),
        centers=center,
        volumes=np.full(len(center), 4.0 / 3.0 * np.pi * _RADII_M.prod()),
        class_names=("ellipsoid",) * len(center),
        ellipsoids=np.array([_core.ellipsoid_from_axes(c, _RADII_M, q) for c, q in rows]),
    )


def _exact_boxes(
    camera: Camera, truth: Truth, area_of_pose: Ints, objects: int
) -> tuple[Ints, Ints, Floats]:
    """Return pose and object row of each box, (b,), poses ascending, and the boxes, (b, 4)."""
    assert truth.ellipsoids is not None
    found = []
    for area in range(area_of_pose[-1] + 1):  # an object is seen from its area and those beside
        near = np.flatnonzero(np.abs(area_of_pose - area) <= 1)
        rows = np.arange(area * objects, (area + 1) * objects)
        pairs, columns = np.nonzero(_in_view(camera, truth.poses[near], truth.centers[rows]))
        pose, row = near[pairs], rows[columns]
        box, in_front = _core.project_to_boxes(
            PoseModel.SE2, camera, truth.poses[pose], truth.ellipsoids[row]
        )
        low, high = -0.5, np.array([camera.width, camera.height]) - 0.5
        whole = in_front & (box[:, :2] >= low).all(axis=1) & (box[:, 2:] <= high).all(axis=1)
        found.append((pose[whole], row[whole], box[whole]))
    pose, row, box = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.lexsort((row, pose))
    return pose[order], row[order], box[order]


def _in_view(camera: Camera, poses: Floats, centers: Floats) -> Bools:
    """Tell which centers are inside of the image, at a depth that is seen; shape (n, o)."""
    from_robot = centers[None, :, :2] - poses[:, None, :2]
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    forward = cos * from_robot[..., 0] + sin * from_robot[..., 1]
    depth = cos * from_robot[..., 1] - sin * from_robot[..., 0]  # the camera looks to the left
    up = centers[:, 2] - _CAMERA_HEIGHT_M
    inside = np.abs(forward) <= depth * camera.width / 2.0 / camera.fx
    inside &= np.abs(up) <= depth * camera.height / 2.0 / camera.fy
    return np.asarray(inside & (depth >= _DEPTH_M[0]) & (depth <= _DEPTH_M[1]))


def _near_centers(recording: Recording, truth: Truth, random: Generator) -> Floats:
    """Return Problem.peer_centers."""
    noise = _START_SIGMA_M * random.normal(size=truth.centers.shape)
    seen, first = np.unique(recording.detections.object_id, return_index=True)
    pose = recording.detections.pose[first]  # boxes are in the order of poses
    odometry = recording.odometry
    reckoned = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)[pose]
    true = truth.poses[pose]
    rows = np.searchsorted(truth.object_ids, seen)
    turn = reckoned[:, 2] - true[:, 2]
    from_robot = truth.centers[rows, :2] - true[:, :2]
    center = truth.centers[rows].copy()
    center[:, 0] = (
        reckoned[:, 0] + np.cos(turn) * from_robot[:, 0] - np.sin(turn) * from_robot[:, 1]
    )
    center[:, 1] = (
        reckoned[:, 1] + np.sin(turn) * from_robot[:, 0] + np.cos(turn) * from_robot[:, 1]
    )
    return np.asarray(center + noise[rows])
