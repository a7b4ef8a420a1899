"""Messages of Foxglove: their small parts, and what moves at the time of a pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dqslam._checks import Floats
from dqslam.view.scene import rgb
from dqslam.view.tracks import SceneTrack

WORLD = "world"
_LABEL_M = 0.5  # what moves is larger than most objects of a map, and farther away


def moving_cuboids(tracks: Sequence[SceneTrack], frame: int, stamp: Any) -> Any:
    """Return what moves at a pose as a SceneUpdate that replaces the one before it."""
    from foxglove.messages import SceneEntityDeletion, SceneEntityDeletionType, SceneUpdate

    shown = [(one, one.row_at(frame)) for one in tracks]
    clear = SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)
    return SceneUpdate(
        deletions=[clear],
        entities=[_cuboid(one, row, stamp) for one, row in shown if row is not None],
    )


def _cuboid(shown: SceneTrack, row: int, stamp: Any) -> Any:
    """Return a thing in one of its images: a cube, an arrow as long as it ahead, and its name."""
    from foxglove.messages import (
        ArrowPrimitive,
        Color,
        CubePrimitive,
        KeyValuePair,
        SceneEntity,
        TextPrimitive,
    )

    track = shown.track
    center, turn, length = track.centers[row], track.orientations[row], float(track.sides[0])
    cube = CubePrimitive(
        pose=pose(center, turn), size=vector(track.sides), color=color(shown.color, 0.6)
    )
    arrow = ArrowPrimitive(
        pose=pose(center, turn),
        shaft_length=0.8 * length,
        shaft_diameter=0.05 * length,
        head_length=0.2 * length,
        head_diameter=0.12 * length,
        color=color(shown.color, 1.0),
    )
    text = TextPrimitive(
        pose=pose(center, np.array([0.0, 0.0, 0.0, 1.0])),
        billboard=True,
        font_size=_LABEL_M,
        color=Color(r=1.0, g=1.0, b=1.0, a=1.0),
        text=shown.name_at(row),
    )
    told = (
        ("id", str(track.track_id)),
        ("class", track.class_name),
        ("behavior", track.behavior),
        ("is moving", "yes" if track.is_moving[row] else "no"),
        ("speed", f"{track.speeds[row]:.2f} ± {track.speed_sigmas[row]:.2f} m/s"),
        ("size", " × ".join(f"{side:.2f}" for side in track.sides) + " m"),
    )
    return SceneEntity(
        timestamp=stamp,
        frame_id=WORLD,
        id=f"track {track.track_id}",
        cubes=[cube],
        arrows=[arrow],
        texts=[text],
        metadata=[KeyValuePair(key=name, value=value) for name, value in told],
    )


def pose(position: Floats, xyzw: Floats) -> Any:
    """Return a pose of a position (3,) [m] and a quaternion (4,)."""
    from foxglove.messages import Pose

    return Pose(position=vector(position), orientation=quaternion(xyzw))


def vector(values: Floats) -> Any:
    """Return a vector of values (3,)."""
    from foxglove.messages import Vector3

    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def quaternion(xyzw: Floats) -> Any:
    """Return a quaternion of x y z w."""
    from foxglove.messages import Quaternion

    x, y, z, w = xyzw.tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def color(text: str, alpha: float) -> Any:
    """Return a color of ``#rrggbb`` and its opacity, 0 to 1."""
    from foxglove.messages import Color

    red, green, blue = (value / 255 for value in rgb(text))
    return Color(r=red, g=green, b=blue, a=alpha)
