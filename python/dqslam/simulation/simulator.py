"""Simulated recordings: from a scenario and a seed to the recording of a robot."""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from dqslam._checks import Bools, Floats, Ints, require
from dqslam.recording import Recording, RelativePositions, Truth
from dqslam.simulation.camera import given_camera, true_camera
from dqslam.simulation.detector import Streams, detect, hide, is_in_image
from dqslam.simulation.odometry import leave_gaps, measure_odometry
from dqslam.simulation.path import TruePath, move, poses_later
from dqslam.simulation.projection import (
    Bodies,
    Ellipsoids,
    Polyhedra,
    Views,
    centers_in_robot,
)
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.world import World, draw_world, true_answer


def simulate(scenario: Scenario, *, seed: int) -> tuple[Recording, Truth]:
    """Move through a world of objects and record odometry, boxes and relative positions.

    World, odometry, boxes, positions, wrong ids, path and each further disturbance have a random
    stream of their own, and every pair of pose and object its own numbers: changing one setting
    leaves the others' noise as it was. Objects are in the recording only if they were detected; the
    truth has all. Wrong are the ids of boxes only; a relative position is always its object's.

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
    # New streams are appended, so that older scenarios keep their numbers.
    for_world, for_odometry, for_boxes, for_positions, for_ids, for_path, *others = map(
        default_rng, SeedSequence(seed).spawn(12)
    )
    for_disturbances, for_gaps, for_tails, for_misses, for_bursts, for_false = others
    motion = move(scenario.path, for_path)
    world = draw_world(scenario, motion, for_world)
    truth = true_answer(scenario, motion, world)

    box, is_seen = _boxes(scenario, motion, world, truth)
    streams = Streams(for_boxes, for_ids, for_tails, for_misses, for_bursts, for_false)
    camera = true_camera(scenario.camera)
    detections, object_row = detect(
        box, is_seen, world.center, truth.class_names, camera, scenario.detector, streams
    )
    period = scenario.path.period_s
    recording = Recording(
        camera=given_camera(scenario.camera, scenario.calibration),
        timestamps=np.arange(len(motion.poses), dtype=np.float64) * period,
        odometry=measure_odometry(
            motion, scenario.odometry, period, for_odometry, for_disturbances
        ),
        detections=detections,
        positions=_positions(scenario, motion, world, (detections.pose, object_row), for_positions),
    )
    shown = np.where(object_row < 0, -1, truth.object_ids[object_row])
    truth = replace(truth, box_object_id=shown)
    recording = _only_with_boxes(recording)
    gaps = scenario.odometry.gaps
    return (recording, truth) if gaps is None else leave_gaps(recording, truth, gaps, for_gaps)


def _boxes(
    scenario: Scenario, motion: TruePath, world: World, truth: Truth
) -> tuple[Floats, Bools]:
    """Return the boxes of all objects from all poses, (n, o, 4), and which are seen."""
    camera = true_camera(scenario.camera)
    late = scenario.calibration.time_offset_s / scenario.path.period_s
    poses = motion.poses if late == 0.0 else poses_later(motion, late)
    views = Views(camera, motion.pose_model, poses)
    bodies = _bodies(scenario, world, truth)
    box, in_front = bodies.boxes(views)
    max_hidden = scenario.detector.occlusion_max_hidden
    if max_hidden is None:
        return box, in_front
    outline = partial(bodies.outline, views)
    is_wanted = is_in_image(box, camera)
    return hide(box, in_front, is_wanted, views.distances(world.center), outline, max_hidden)


def _bodies(scenario: Scenario, world: World, truth: Truth) -> Bodies:
    if truth.ellipsoids is not None:
        return Ellipsoids(truth.ellipsoids)
    is_cube = scenario.objects == "cubes"
    return Polyhedra(world.cube_corners() if is_cube else world.cuboid_corners())


def _positions(
    scenario: Scenario,
    motion: TruePath,
    world: World,
    seen: tuple[Ints, Ints],
    random: Generator,
) -> RelativePositions:
    """Measure the centers of the objects at the poses from which boxes show them."""
    sigma = scenario.relative_position.sigma_m
    in_robot = centers_in_robot(motion.pose_model, motion.poses, world.center)
    measured = in_robot + random.normal(0.0, sigma, size=in_robot.shape)
    pose, row = (rows[seen[1] >= 0] for rows in seen)
    return RelativePositions(
        pose=pose,
        object_id=row,
        object_in_robot=measured[pose, row],
        covariance=np.tile(sigma**2 * np.eye(3), (len(row), 1, 1)),
    )


def _only_with_boxes(recording: Recording) -> Recording:
    """Leave out positions of objects whose id no box carries."""
    positions = recording.positions
    if positions is None:
        return recording
    has_box = np.isin(positions.object_id, recording.detections.object_id)
    return replace(recording, positions=positions.select(has_box))
