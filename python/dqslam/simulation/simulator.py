"""Simulated recordings: from a scenario and a seed to the recording of a robot."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from dqslam import _core
from dqslam._checks import Bools, Floats, require
from dqslam._core import Camera, PoseModel
from dqslam.recording import Detections, Recording, RelativePositions, Truth
from dqslam.simulation.detector import associate, cut_at_border, is_detected
from dqslam.simulation.path import TruePath, measure_odometry, move
from dqslam.simulation.scenario import (
    CameraSettings,
    InsidePathSettings,
    LogNormalSizeSettings,
    OnTableSettings,
    Scenario,
)

# Axes of a level camera (x right, y down, z forward) on a mount (x forward, y left, z up).
_MOUNT_FROM_CAMERA = [0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]
_UP = [0.0, 0.0, 1.0]
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


class _World(NamedTuple):
    center: Floats  # in the world, m, (o, 3)
    side: Floats  # of the cubes, m, (o,)
    yaw: Floats  # of the cubes, rad, (o,)
    semi_axes: Floats  # of the ellipsoids, m, (o, 3)
    orientation: Floats  # of the ellipsoids, world_from_object, quaternions, (o, 4)


def simulate(scenario: Scenario, *, seed: int) -> tuple[Recording, Truth]:
    """Move through a world of objects and record odometry, boxes and relative positions.

    World, odometry, boxes, positions, wrong ids and path each have a random stream of their own,
    and every pair of pose and object its own numbers: changing one setting leaves the others' noise
    as it was. Objects are in the recording only if they were detected; the truth has all. Wrong are
    the ids of boxes only; a relative position is always its object's.

    Examples
    --------
    The same seed draws the same world and the same drive through it:

    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> recording
    Recording(SE2, 253 poses, 456 boxes of 10 objects, 1 class, 456 positions)
    >>> truth
    Truth(SE2, 253 poses, 10 objects)
    """
    require(scenario, Scenario, "simulate", 'load_scenario("paper")')
    if seed < 0:
        raise ValueError(f"seed: expected zero or more, got {seed}")
    for_world, for_odometry, for_boxes, for_positions, for_ids, for_path = map(
        default_rng, SeedSequence(seed).spawn(6)
    )
    camera = _camera(scenario.camera)
    motion = move(scenario.path, for_path)
    world = _draw_world(scenario, motion.poses, for_world)
    truth = _truth(scenario, motion, world)

    box, in_front = _boxes(camera, truth, world)
    seen = np.argwhere(in_front & is_detected(box, camera, scenario.detector))
    pose, object_row = seen[:, 0], seen[:, 1]
    said = associate(pose, object_row, world.center, scenario.detector, for_ids)
    box_noise = for_boxes.normal(0.0, scenario.detector.edge_sigma_px, size=box.shape)
    measured = (box + box_noise)[pose, object_row]
    truncated = np.zeros(measured.shape, dtype=np.bool_)
    if scenario.detector.truncation == "clip":
        measured, truncated = cut_at_border(measured, camera)
    detections = Detections(
        pose=pose,
        box=measured,
        score=np.ones(len(seen)),
        class_id=np.zeros(len(seen), dtype=np.int64),
        object_id=truth.object_id[said],
        class_names={0: truth.class_name[0]},
        truncated=truncated,
    )
    has_box = np.isin(truth.object_id[object_row], detections.object_id)
    sigma = scenario.relative_position.sigma_m
    in_robot = _in_robot(motion, world.center)
    position_noise = for_positions.normal(0.0, sigma, size=in_robot.shape)
    recording = Recording(
        camera=camera,
        timestamps=np.arange(len(motion.poses), dtype=np.float64) * scenario.path.period_s,
        odometry=measure_odometry(motion, scenario.odometry, for_odometry),
        detections=detections,
        positions=RelativePositions(
            pose=pose[has_box],
            object_id=truth.object_id[object_row][has_box],
            object_in_robot=(in_robot + position_noise)[pose, object_row][has_box],
            covariance=np.tile(sigma**2 * np.eye(3), (int(has_box.sum()), 1, 1)),
        ),
    )
    return recording, replace(truth, box_object_id=truth.object_id[object_row])


def _camera(settings: CameraSettings) -> Camera:
    """Make the core's camera; its principal point is the middle of the image."""
    half_heading = np.deg2rad(settings.heading_deg) / 2.0
    robot_from_mount = [
        [*settings.position_in_robot_m, 0.0, 0.0, np.sin(half_heading), np.cos(half_heading)]
    ]
    robot_from_camera = _core.compose(PoseModel.SE3, robot_from_mount, [_MOUNT_FROM_CAMERA])[0]
    focal_px = 1000.0 * settings.focal_length_mm / settings.pixel_size_um
    return Camera(
        focal_px,
        focal_px,
        (settings.width_px - 1) / 2.0,
        (settings.height_px - 1) / 2.0,
        settings.width_px,
        settings.height_px,
        robot_from_camera=robot_from_camera,
    )


def _draw_world(scenario: Scenario, poses: Floats, random: Generator) -> _World:
    """Place objects uniformly; every kind of object uses the same numbers."""
    world = scenario.world
    if isinstance(world, InsidePathSettings):
        place = _inside_path(world, poses, random)
    else:
        place = _above_table(world, random)
    side = random.normal(world.side_mean_m, world.side_sigma_m, size=world.object_count)
    side = np.maximum(world.side_min_m, side)
    yaw = random.uniform(-np.pi, np.pi, size=world.object_count)
    factor = random.uniform(*world.semi_axis_factor, size=(world.object_count, 3))
    semi_axes = factor * side[:, None] / 2.0
    orientation = np.column_stack([np.zeros((len(yaw), 2)), np.sin(yaw / 2.0), np.cos(yaw / 2.0)])
    if world.log_normal_size is not None:
        semi_axes, orientation = _log_normal(world.log_normal_size, world.object_count, random)
    if isinstance(world, OnTableSettings):
        ellipsoid_height = _half_height(semi_axes, orientation)
        place[:, 2] += side / 2.0 if scenario.objects == "cubes" else ellipsoid_height
    return _World(place, side, yaw, semi_axes, orientation)


def _log_normal(
    size: LogNormalSizeSettings, count: int, random: Generator
) -> tuple[Floats, Floats]:
    """Draw ellipsoids from a size prior: semi-axes (o, 3) and orientations (o, 4)."""
    from scipy.spatial.transform import Rotation

    normal = random.normal(size=(count, 3, 3))
    # Symmetric, with variance 1 on the diagonal and 1/2 off it, so that it is isotropic.
    logarithm, axes = np.linalg.eigh((normal + normal.transpose(0, 2, 1)) / 2.0)
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]  # right-handed
    semi_axes = size.median_m * size.spread**logarithm
    return np.asarray(semi_axes), Rotation.from_matrix(axes).as_quat()


def _half_height(semi_axes: Floats, orientation: Floats) -> Floats:
    """Return the height of the top of ellipsoids above their centers, m, (o,)."""
    from scipy.spatial.transform import Rotation

    up_in_object = Rotation.from_quat(orientation).inv().apply(_UP)
    return np.asarray(np.linalg.norm(semi_axes * up_in_object, axis=1))


def _inside_path(world: InsidePathSettings, poses: Floats, random: Generator) -> Floats:
    """Return centers, (o, 3)."""
    low = poses[:, :2].min(axis=0) + world.margin_m
    high = poses[:, :2].max(axis=0) - world.margin_m
    if (low > high).any():
        raise ValueError(f"world.margin_m: {world.margin_m} m leaves no room inside the path")
    ground = random.uniform(low, high, size=(world.object_count, 2))
    height = random.normal(0.0, world.height_sigma_m, size=(world.object_count, 1))
    return np.hstack([ground, height])


def _above_table(world: OnTableSettings, random: Generator) -> Floats:
    """Return the points under the objects where they would rest, (o, 3)."""
    size = np.array([world.length_m, world.width_m])
    ground = random.uniform(-size / 2.0, size / 2.0, size=(world.object_count, 2))
    lift = random.uniform(0.0, world.lift_max_m, size=(world.object_count, 1))
    return np.hstack([ground, lift])


def _truth(scenario: Scenario, motion: TruePath, world: _World) -> Truth:
    count = len(world.center)
    if scenario.objects == "cubes":
        ellipsoids, volume = None, world.side**3
    else:
        rows = zip(world.center, world.semi_axes, world.orientation, strict=True)
        ellipsoids = np.array([_core.ellipsoid_from_axes(*row) for row in rows])
        volume = 4.0 / 3.0 * np.pi * world.semi_axes.prod(axis=1)
    return Truth(
        pose_model=motion.pose_model,
        poses=motion.poses,
        object_id=np.arange(count),
        center=world.center,
        volume=volume,
        class_name=(scenario.objects.removesuffix("s"),) * count,
        ellipsoids=ellipsoids,
    )


def _boxes(camera: Camera, truth: Truth, world: _World) -> tuple[Floats, Bools]:
    """Return the exact boxes of all objects from all poses, (n, o, 4), and which are in front."""
    if truth.ellipsoids is None:
        return _cube_boxes(camera, truth, world)
    poses, objects = len(truth.poses), len(truth.center)
    box, in_front = _core.project_to_boxes(
        truth.pose_model,
        camera,
        np.repeat(truth.poses, objects, axis=0),
        np.tile(truth.ellipsoids, (poses, 1)),
    )
    return box.reshape(poses, objects, 4), in_front.reshape(poses, objects)


def _cube_boxes(camera: Camera, truth: Truth, world: _World) -> tuple[Floats, Bools]:
    """Bound the projected corners of cubes."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_rotvec(np.outer(world.yaw, _UP)).as_matrix() @ _CORNERS.T  # (o, 3, 8)
    corners = world.center[:, :, None] + world.side[:, None, None] * turned
    world_from_camera = _core.world_from_camera(truth.pose_model, camera, truth.poses)
    rotation = Rotation.from_quat(world_from_camera[:, 3:]).as_matrix()
    from_camera = corners[None] - world_from_camera[:, None, :3, None]  # (n, o, 3, 8)
    x, y, z = np.moveaxis(np.einsum("nji,nojc->noic", rotation, from_camera), 2, 0)
    in_front = (z > 0.0).all(axis=2)
    z = np.where(in_front[:, :, None], z, np.nan)
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    return np.stack([u.min(2), v.min(2), u.max(2), v.max(2)], axis=2), in_front


def _in_robot(motion: TruePath, center: Floats) -> Floats:
    """Return the objects' centers in the frames of all robots, meters, shape (n, o, 3)."""
    from scipy.spatial.transform import Rotation

    in_place = Camera(1.0, 1.0, 0.0, 0.0, 1, 1)  # its frame is the robot's
    world_from_robot = _core.world_from_camera(motion.pose_model, in_place, motion.poses)
    rotation = Rotation.from_quat(world_from_robot[:, 3:]).as_matrix()
    from_robot = center[None] - world_from_robot[:, None, :3]
    return np.asarray(np.einsum("nji,noj->noi", rotation, from_robot))
