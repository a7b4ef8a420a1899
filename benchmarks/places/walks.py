"""Answers of ``dqslam locate`` from several images of a walk, with odometry between them."""

from collections import Counter
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import dqslam as dq
from benchmarks.places import rooms, worlds
from benchmarks.places.locate import RIGHT_M, RIGHT_RAD, SE3
from benchmarks.places.locate_worlds import IMAGES_OF_MAP

VOTERS = (1, 4, 8, 12)
WALKS, WALKS_ELSEWHERE = 4, 1
# Of a walk: meters a step, and how much it turns and the camera pans in a step [rad].
STEP_M, TURN_RAD, PAN_RAD = 0.25, 0.15, 0.12
NOISE = dq.OdometryNoise(0.01, 0.005)


def count_walks(
    count: Annotated[int, typer.Option(help="Worlds of each kind.")] = 5,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 200,
    kind: Annotated[str, typer.Option(help="Only kinds whose names contain this.")] = "",
) -> None:
    """Locate the ends of walks by 1, 4, 8 and 12 images: 4 walks in each world, 1 in another."""
    table = Table(title=f"{count} worlds of each kind from seed {seed}: right, wrong of all walks")
    table.add_column("kind")
    for images in VOTERS:
        table.add_column(f"{images} images" if images > 1 else "1 image", justify="right")
    for name in (name for name in worlds.KINDS if kind in name):
        counts: Counter[tuple[int, bool]] = Counter()
        for number in range(seed, seed + count):
            _walk_in(name, number, counts)
            typer.echo(f"== {name}, world {number}", err=True)
        total = count * (WALKS + WALKS_ELSEWHERE)
        cells = [f"{counts[one, True]}, {counts[one, False]} of {total}" for one in VOTERS]
        table.add_row(name, *cells)
    Console(width=110).print(table)


def _walk_in(kind: str, seed: int, counts: Counter[tuple[int, bool]]) -> None:
    """Count the answers, by the number of images and whether they are right."""
    random = np.random.default_rng([seed, list(worlds.KINDS).index(kind)])
    world = worlds.draw_world(kind, random)
    place = dq.PlaceMap.of(rooms.map_room(world.mapped, IMAGES_OF_MAP, random, world.detector))
    for where in [world.later] * WALKS + [world.other] * WALKS_ELSEWHERE:
        poses = _walk(world.draw_poses(where, 1, random)[0], kind == "corridors", random)
        seen = rooms.draw_boxes(where, poses, random, world.detector)
        boxes = rooms.detections_of(where, seen)
        steps = dq._core.between(SE3, poses[:-1], poses[1:])
        sigma = np.repeat([NOISE.translation_m, NOISE.rotation_rad], 3)
        steps = dq._core.plus(SE3, steps, random.normal(0.0, 1.0, (len(steps), 6)) * sigma)
        start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        odometry = dq._core.dead_reckon(SE3, start, steps)
        for images in VOTERS:
            own = boxes.select(boxes.pose >= len(poses) - images)
            if not len(own):
                continue
            found = dq.locate(place, own, rooms.CAMERA, odometry=odometry, odometry_noise=NOISE)
            if found.is_found:
                apart = dq._core.minus(SE3, poses[[found.image]], found.pose[None])[0]
                near = np.linalg.norm(apart[:3]) < RIGHT_M
                near &= np.linalg.norm(apart[3:]) < RIGHT_RAD
                counts[images, bool(near and where is world.later)] += 1


def _walk(first: np.ndarray, is_straight: bool, random: np.random.Generator) -> np.ndarray:
    """Return the poses of a walk from a first one, along x or in any direction, (n, 7)."""
    from scipy.spatial.transform import Rotation

    heading = random.choice([0.0, np.pi]) if is_straight else random.uniform(-np.pi, np.pi)
    poses = [first]
    for _ in range(VOTERS[-1] - 1):
        pose = poses[-1].copy()
        pose[:2] += STEP_M * np.array([np.cos(heading), np.sin(heading)])
        pan = Rotation.from_euler("z", random.normal(0.0, PAN_RAD))
        pose[3:] = (pan * Rotation.from_quat(pose[3:])).as_quat()
        heading += 0.0 if is_straight else random.normal(0.0, TURN_RAD)
        poses.append(pose)
    return np.array(poses)
