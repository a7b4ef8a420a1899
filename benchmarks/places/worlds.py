"""Places unlike the rooms that the confidence of ``locate`` was fitted to, and other detectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.places import rooms
from benchmarks.places.rooms import Detector, Room


@dataclass(frozen=True, eq=False)
class World:
    """A place when its map is made, the same place later, and another place of the kind."""

    mapped: Room
    later: Room
    other: Room
    detector: Detector
    draw_poses: Callable[[Room, int, np.random.Generator], np.ndarray] = rooms.draw_poses


def draw_world(kind: str, random: np.random.Generator) -> World:
    """Draw a world of a kind, a key of ``KINDS``."""
    return KINDS[kind](random)


def _world(room: Room, other: Room, random: np.random.Generator, **more: object) -> World:
    changed = float(more.pop("changed", 0.15))  # type: ignore[arg-type]
    detector = Detector(**more)  # type: ignore[arg-type]
    return World(room, rooms.change_room(room, changed, random), other, detector)


def _usual(random: np.random.Generator, **more: object) -> World:
    """Return a room as those of the fit."""
    room = rooms.draw_room(random)
    other = rooms.draw_objects(room, len(room.class_id), random)
    return _world(room, other, random, **more)


def _room(
    random: np.random.Generator,
    extent: tuple[float, float],
    count: tuple[int, int],
    classes: tuple[int, int],
    size: float,
    height: float = 1.0,
    **more: object,
) -> World:
    """Return a room whose numbers are within bounds, with heights times a factor."""
    side, number = random.uniform(*extent), int(random.integers(*count))
    kinds = int(random.integers(*classes))
    usual = np.exp(random.normal(np.log(size), 0.4, (kinds, 3)))
    room = rooms.furnish(side, usual, random.integers(0, kinds, number), random)
    other = rooms.furnish(side, usual, random.integers(0, kinds, number), random)
    for one in (room, other):
        one.centers[:, 2] *= height
    return _world(room, other, random, **more)


def _groups(random: np.random.Generator) -> World:
    """Return a room of tables with chairs, each group laid out as the others."""
    usual = np.exp(random.normal(np.log(0.25), 0.3, (4, 3)))
    chairs = int(random.integers(2, 6))
    angle = 2.0 * np.pi * np.arange(chairs) / chairs
    group = np.vstack(
        [[0.0, 0.0, 0.7], np.column_stack([np.cos(angle), np.sin(angle), 0 * angle + 0.5])]
    )
    kinds = np.array([0] + [1] * chairs)

    def lay() -> Room:
        wide, deep = int(random.integers(2, 5)), int(random.integers(2, 4))
        spacing, side = random.uniform(2.2, 3.5), 3.0 * max(wide, deep)
        grid = np.stack(np.meshgrid(np.arange(wide), np.arange(deep)), axis=-1).reshape(-1, 2)
        at = np.hstack([(grid - grid.mean(axis=0)) * spacing, np.zeros((len(grid), 1))])
        repeated = (at[:, None] + group).reshape(-1, 3)
        extra = int(random.integers(2, 8))
        class_id = np.concatenate([np.tile(kinds, len(grid)), random.integers(2, 4, extra)])
        room = rooms.furnish(side, usual, class_id, random)
        room.centers[: len(repeated)] = repeated + random.normal(0.0, 0.04, repeated.shape)
        return room

    return _world(lay(), lay(), random)


def _corridor(random: np.random.Generator) -> World:
    """Return a corridor whose doors, lamps and signs follow one another evenly."""
    usual = np.array([[0.45, 0.05, 1.0], [0.15, 0.15, 0.05], [0.1, 0.03, 0.1], [0.3, 0.3, 0.4]])

    def lay() -> Room:
        length, spacing = random.uniform(15.0, 40.0), random.uniform(2.0, 4.0)
        x = np.arange(-0.5 * length, 0.5 * length, spacing)
        parts = [np.column_stack([x, side + 0 * x, 1.0 + 0 * x]) for side in (-1.2, 1.2)]
        parts.append(np.column_stack([x + 0.5 * spacing, 0 * x, 2.5 + 0 * x]))
        parts.append(np.column_stack([x + 0.6, 1.15 + 0 * x, 1.6 + 0 * x]))
        extra = int(random.integers(3, 10))
        strewn = random.uniform([-0.5 * length, -1.0, 0.2], [0.5 * length, 1.0, 1.0], (extra, 3))
        class_id = np.repeat([0, 0, 1, 2, 3], [len(x), len(x), len(x), len(x), extra])
        room = rooms.furnish(length, usual, class_id, random)
        room.centers[:] = np.vstack([*parts, strewn])
        room.centers[:] += random.normal(0.0, 0.03, room.centers.shape)
        room.turns[:] = [0.0, 0.0, 0.0, 1.0]
        room.semi_axes[:] = usual[class_id]
        return room

    return replace(_world(lay(), lay(), random), draw_poses=_walk_corridor)


def _walk_corridor(room: Room, count: int, random: np.random.Generator) -> np.ndarray:
    poses = rooms.draw_poses(replace(room, extent=1.2), count, random)
    shift = random.uniform(-0.5, 0.5, count) * room.extent
    for pose, along in zip(poses, shift, strict=True):
        # Look at an object of the corridor that is a few meters away.
        near = np.flatnonzero(np.abs(room.centers[:, 0] - along) < 5.0)
        pose[0] = along
        if near.size:
            pose[3:] = _level_turn(room.centers[random.choice(near)] - pose[:3])
    return poses


def _level_turn(direction: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    z = direction / np.linalg.norm(direction)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= max(float(np.linalg.norm(x)), 1e-9)
    return np.asarray(Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z])).as_quat())


def _shelves(random: np.random.Generator) -> World:
    """Return shelves: a few kinds of equal things in a grid along two walls."""
    kinds = int(random.integers(1, 4))
    usual = np.exp(random.normal(np.log(0.12), 0.2, (kinds, 3)))

    def lay() -> Room:
        columns, side = int(random.integers(6, 12)), random.uniform(4.0, 7.0)
        x = np.linspace(-0.5 * side, 0.5 * side, columns)
        grid = np.stack(np.meshgrid(x, [-0.5 * side, 0.5 * side], [0.5, 1.0, 1.5]), axis=-1)
        grid = grid.reshape(-1, 3)[random.random(grid.size // 3) < 0.7]
        room = rooms.furnish(side, usual, random.integers(0, kinds, len(grid)), random)
        room.centers[:] = grid + random.normal(0.0, 0.03, grid.shape)
        return room

    return _world(lay(), lay(), random)


def _unmapped(random: np.random.Generator) -> World:
    """Return a room in which as many objects again have been put since the map was made."""
    world = _usual(random)
    more = rooms.draw_objects(world.mapped, len(world.mapped.class_id), random)
    return replace(world, later=rooms.join(world.later, more))


KINDS: dict[str, Callable[[np.random.Generator], World]] = {
    "rooms as those of the fit": _usual,
    "desks": lambda r: _room(r, (1.5, 3.0), (6, 25), (3, 9), 0.06, 0.7),
    "halls": lambda r: _room(r, (15.0, 30.0), (60, 200), (3, 9), 0.4, 3.0, farthest_m=15.0),
    "high rooms": lambda r: _room(r, (4.0, 8.0), (10, 50), (3, 9), 0.15, 4.0),
    "one class": lambda r: _room(r, (4.0, 10.0), (8, 50), (1, 2), 0.15),
    "two classes": lambda r: _room(r, (4.0, 10.0), (8, 50), (2, 3), 0.15),
    "many classes": lambda r: _room(r, (4.0, 10.0), (15, 60), (20, 40), 0.15),
    "tables with chairs": _groups,
    "corridors": _corridor,
    "shelves": _shelves,
    "wrong classes, 30 %": lambda r: _usual(r, confusion=0.3),
    "false boxes, 4 an image": lambda r: _usual(r, false_boxes=4.0),
    "half of the objects found": lambda r: _usual(r, best_rate=0.45),
    "cuboids, errors of 8 %": lambda r: _usual(r, relative=0.08, cuboids=True),
    "half of the objects changed": lambda r: _usual(r, changed=0.5),
    "half of the objects not in the map": _unmapped,
}
