"""Trajectories from COLMAP's ``images.txt``: two lines for each image.

The first is ``IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME``, the pose camera_from_world, which is
inverted; the second has points and is skipped. COLMAP's unit of length is arbitrary. The name tells
the frame or the time of an image, see `dqslam.io.image_names`; images may be in any order.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.io.files import FileError, in_reach, read_text
from dqslam.io.formats import Format, Look, ReadContext
from dqslam.io.image_names import ImageNameError, frames_of_images, have_times, image_name
from dqslam.io.trajectory.table import (
    NORM_TOLERANCE,
    Trajectory,
    make_trajectory,
    parse_columns,
)

FIELDS = ("qw", "qx", "qy", "qz", "tx", "ty", "tz")
CAMERA, NAME = 8, 9  #: places in a line
NUMBERS = re.compile(r"[-+.\deE\s]+")


def read_colmap(path: str | Path, context: ReadContext) -> Trajectory:
    """Read the poses of a reconstruction in the order of time."""
    rows, lines = _images(path)
    cameras = sorted({row[CAMERA] for row in rows})
    if len(cameras) > 1:
        raise FileError(path, f"its images are of {len(cameras)} cameras, not of one")
    table = parse_columns(path, FIELDS, [row[1:8] for row in rows], lines)
    poses = np.hstack([table[:, 4:], table[:, [1, 2, 3, 0]]])
    length = np.linalg.norm(poses[:, 3:], axis=1)
    unit = np.abs(length - 1) < NORM_TOLERANCE  # the others are refused below
    poses[unit, 3:] /= length[unit, None]
    poses[unit] = _core.inverse(_core.PoseModel.SE3, poses[unit])
    times = _times(path, [row[NAME] for row in rows], lines, context)
    order = np.argsort(times, kind="stable")
    return make_trajectory(path, times[order], poses[order], [lines[row] for row in order], context)


def _images(path: str | Path) -> tuple[list[list[str]], list[int]]:
    """Return the fields of the first line of each image, and its number."""
    rows: list[list[str]] = []
    numbers: list[int] = []
    points = False  # the next line has the points of an image, and may be blank
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if line.lstrip().startswith("#"):
            continue
        fields = line.split(maxsplit=NAME)
        if points and not _is_image(fields):
            points = False
            continue
        if not fields:
            continue
        if len(fields) != NAME + 1:
            message = f"{len(fields)} fields, not 10: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
            raise FileError(path, message, number)
        rows.append(fields)
        numbers.append(number)
        points = True
    if not rows:
        raise FileError(path, "holds no images")
    return rows, numbers


def _is_image(fields: list[str]) -> bool:
    """Return whether these fields are an image: whole ids, and a unit quaternion."""
    if len(fields) != NAME + 1 or not (fields[0].isdigit() and fields[CAMERA].isdigit()):
        return False
    if len(fields[NAME].split()) > 1 and NUMBERS.fullmatch(fields[NAME]):
        return False  # a frame and a matrix of KITTI-360, not a turned camera
    try:
        quaternion = in_reach(np.array(fields[1:5], dtype=float))
    except ValueError:
        return False
    return bool(abs(np.linalg.norm(quaternion) - 1) < NORM_TOLERANCE)


def _times(path: str | Path, names: list[str], lines: list[int], context: ReadContext) -> Floats:
    if context.frames is not None and context.frames.names:
        places = context.frames.names
        for name, line in zip(names, lines, strict=True):
            if image_name(name) not in places:
                raise FileError(path, f"{context.frames.source} has no image {name}", line)
        frames = np.array([places[image_name(name)] for name in names])
        return context.frames.at(path, frames, lines)
    try:
        frames, times = frames_of_images(names)
    except ImageNameError as error:
        raise FileError(path, f"{names[error.row]}: {error}", lines[error.row]) from None
    if times is not None:
        return times
    if context.frames is None:
        raise FileError(
            path, "colmap has no times: give them with --frame-times FILE or --frame-rate HZ"
        )
    return context.frames.at(path, frames, lines)


def _looks(look: Look) -> bool:
    return "," not in look.first and _is_image(look.first.split(maxsplit=NAME))


COLMAP_IMAGES = Format(
    "colmap-images",
    "10 fields a line, IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME",
    _looks,
    read_colmap,
    needs_times=False,
    has_times=lambda path: have_times([row[NAME] for row in _images(path)[0]]),
)
