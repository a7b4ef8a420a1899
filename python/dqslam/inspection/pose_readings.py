"""Readings of poses that are tried, and the words and options for them."""

from __future__ import annotations

import itertools

import numpy as np

from dqslam.inspection.comparison import GIVEN, PoseReading
from dqslam.io.readings import BODY_AXES, OPENGL_AXES

Matrix = tuple[float, ...]

IDENTITY = GIVEN.axes
MIRROR: Matrix = (-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)
_NAMED = {
    tuple(OPENGL_AXES.ravel().tolist()): ("opengl", "the axes of OpenGL, y up and z backward"),
    tuple(BODY_AXES.ravel().tolist()): (
        "body",
        "the axes of a body, x forward and z up: the poses may be those of base_link, say",
    ),
}


def _signed_permutations() -> list[Matrix]:
    matrices = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[order, range(3)] = signs
            matrices.append(tuple(matrix.ravel().tolist()))
    return matrices


ALL_MAPS = _signed_permutations()
TURNS = [one for one in ALL_MAPS if np.linalg.det(np.reshape(one, (3, 3))) > 0]


def usual_readings() -> list[PoseReading]:
    """Return the readings that are usual in other programs, without the given one."""
    readings = [
        PoseReading(w_first=w_first, inverted=inverted, axes=axes)
        for axes in (IDENTITY, *_NAMED)
        for inverted in (False, True)
        for w_first in (False, True)
    ]
    return readings[1:]


def unusual_readings() -> list[PoseReading]:
    """Return readings with any axes, a mirrored world, or positions in axes of their own."""
    usual = {GIVEN, *usual_readings()}
    readings = [
        PoseReading(w_first, positions, inverted, axes)
        for inverted in (False, True)
        for w_first, positions in ((False, IDENTITY), (False, MIRROR), (True, IDENTITY))
        for axes in TURNS
    ]
    readings += [
        PoseReading(positions=positions, inverted=inverted)
        for inverted in (False, True)
        for positions in ALL_MAPS
    ]
    return [reading for reading in dict.fromkeys(readings) if reading not in usual]


def describe(reading: PoseReading) -> str:
    """Say what the poses look like in this reading, with the options that read them so."""
    from scipy.spatial.transform import Rotation

    looks, options = [], []
    if reading.w_first:
        looks.append("quaternions with w first")
        options.append("--poses w_first")
    if reading.positions == MIRROR:
        looks.append("a mirrored (left-handed) world")
        options.append("positions with the opposite sign in the file")
    elif reading.positions != IDENTITY:
        looks.append("positions with other axes than rotations")
        options.append(f"positions x y z of the file replaced by {_rows(reading.positions)}")
    if reading.inverted:
        looks.append("camera_from_world, not world_from_camera")
        options.append("--poses camera_from_world")
    if reading.axes in _NAMED:
        name, words = _NAMED[reading.axes]
        looks.append(words)
        options.append(f"--poses {name}")
    elif reading.axes != IDENTITY:
        turn = Rotation.from_matrix(np.reshape(reading.axes, (3, 3))).as_quat(canonical=True)
        numbers = " ".join(f"{value:g}" for value in [0, 0, 0, *np.round(turn, 6).tolist()])
        looks.append(f"other axes of the camera (x y z are {_columns(reading.axes)} of the file)")
        options.append(f"--camera-in-body FILE with the numbers {numbers}")
    return f"{' and '.join(looks)}: {', '.join(options)}"


def _rows(matrix: Matrix) -> str:
    """Name what the rows of a signed permutation take: "x -z y"."""
    rows = np.reshape(matrix, (3, 3))
    axes = np.argmax(np.abs(rows), axis=1).tolist()
    return " ".join(
        ("-" if row[axis] < 0 else "") + "xyz"[axis] for row, axis in zip(rows, axes, strict=True)
    )


def _columns(matrix: Matrix) -> str:
    return _rows(tuple(np.reshape(matrix, (3, 3)).T.ravel().tolist()))
