"""Answers of ``dqslam locate`` by confidence, in places unlike those that it was fitted to."""

from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import dqslam as dq
from benchmarks.places import rooms, worlds
from benchmarks.places.locate import Answers

BOUNDS = (0.5, 0.8, 0.9, 0.99, 1.01)
IMAGES, IMAGES_ELSEWHERE, IMAGES_OF_MAP = 12, 3, 60


def count_worlds(
    count: Annotated[int, typer.Option(help="Worlds of each kind.")] = 5,
    seed: Annotated[int, typer.Option(help="Of the first one.")] = 100,
    kind: Annotated[str, typer.Option(help="Only kinds whose names contain this.")] = "",
) -> None:
    """Count right answers in 16 kinds of places: 12 images of each, and 3 of another place."""
    table = Table(title=f"{count} worlds of each kind from seed {seed}: right of answers")
    table.add_column("kind")
    for low, high in zip(BOUNDS[:-1], BOUNDS[1:], strict=True):
        name = f"{low:g} to {high:g}" if high < 1.0 else f"{low:g} on"
        table.add_column(name, justify="right")
    for name in ("right from 0.9, of images", "median NEES (5.3)", "CPU [s]"):
        table.add_column(name, justify="right")
    total = Answers()
    images = 0
    for one in (name for name in worlds.KINDS if kind in name):
        found = Answers()
        own = sum(_locate_in(one, number, found) for number in range(seed, seed + count))
        table.add_row(one, *_row(found, own))
        for name, values in vars(total).items():
            values.extend(getattr(found, name))
        images += own
    table.add_section()
    table.add_row("all", *_row(total, images))
    Console(width=140).print(table)


def _locate_in(kind: str, seed: int, answers: Answers) -> int:
    """Locate images of a world; return how many of them are of the place of the map."""
    random = np.random.default_rng([seed, list(worlds.KINDS).index(kind)])
    world = worlds.draw_world(kind, random)
    place = dq.PlaceMap.of(rooms.map_room(world.mapped, IMAGES_OF_MAP, random, world.detector))
    images = 0
    for where, several in ((world.later, IMAGES), (world.other, IMAGES_ELSEWHERE)):
        poses = world.draw_poses(where, several, random)
        seen = rooms.draw_boxes(where, poses, random, world.detector)
        boxes = rooms.detections_of(where, seen)
        for image, pose in enumerate(poses):
            own = boxes.select(boxes.pose == image)
            if len(own):
                answers.add(place, own, rooms.CAMERA, pose if where is world.later else None)
                images += where is world.later
    return images


def _row(found: Answers, images: int) -> list[str]:
    confidence, right = np.array(found.confidence), np.array(found.right)
    complete, nees = np.array(found.complete), np.array(found.nees)
    cells = []
    for low, high in zip(BOUNDS[:-1], BOUNDS[1:], strict=True):
        given = complete & (confidence >= low) & (confidence < high)
        cells.append(f"{(given & right).sum()} of {given.sum()}")
    sure = complete & (confidence >= 0.9)
    middle = f"{np.median(nees[sure & right]):.1f}" if (sure & right).any() else ""
    share = f"{(sure & right).sum() / images:.0%}"
    return [*cells, share, middle, f"{np.mean(found.seconds):.3f}"]
