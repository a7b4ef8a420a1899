"""Pose graphs in g2o's text, for g2o and for GTSAM.

    VERTEX_SE3:QUAT id x y z qx qy qz qw            VERTEX_SE2 id x y theta
    VERTEX_TRACKXYZ id x y z                        VERTEX_XY id x y
    EDGE_SE3:QUAT a b x y z qx qy qz qw I11 ... I66 EDGE_SE2 a b x y theta I11 ... I33
    EDGE_SE3_TRACKXYZ a l 0 x y z I11 ... I33       EDGE_SE2_XY a l x y I11 I12 I22

Vertices are world_from_pose, edges b_in_a. The information is the upper triangle, row by row, of
x y z, then of the rotation. Both programs have this order, but g2o measures a rotation in space by
the vector part of its quaternion, which is half of GTSAM's rotation vector: for g2o, the
information of rotations is four times as large. GTSAM reads edges to landmarks in space only, as
directions and distances, and on the plane it stops at comments and at ``FIX``: its files have
neither. On the plane, landmarks lose their height.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.io.files import write_text
from dqslam.io.pose_graph.graph import PoseGraph

Program = Literal["g2o", "gtsam"]
_OFFSET = 0  # id of the sensor's offset, which is none


def write_g2o(path: str | Path, graph: PoseGraph, *, program: Program = "g2o") -> None:
    """Write a pose graph for a program.

    Poses have the ids 0 to n - 1, and landmarks those from n on, in their order.
    """
    write_text(path, (f"{line}\n" for line in _lines(graph, program)))


def _lines(graph: PoseGraph, program: Program) -> Iterator[str]:
    in_space = graph.pose_model == _core.PoseModel.SE3
    first = len(graph.poses)
    size = 3 if in_space else 2
    for_g2o = program == "g2o"
    if for_g2o:
        yield "# written by dqslam; poses are world_from_pose, meters and radians"
    if in_space:
        yield f"PARAMS_SE3OFFSET {_OFFSET} 0 0 0 0 0 0 1"
    vertex, landmark = (
        ("VERTEX_SE3:QUAT", "VERTEX_TRACKXYZ") if in_space else ("VERTEX_SE2", "VERTEX_XY")
    )
    for row, pose in enumerate(graph.poses):
        yield f"{vertex} {row} {_cells(pose)}"
    if for_g2o:
        yield "FIX 0"
    for row, (name, center) in enumerate(zip(graph.landmark_ids, graph.landmarks, strict=True)):
        if for_g2o:
            yield f"# object {name}"
        yield f"{landmark} {first + row} {_cells(center[:size])}"
    scale = np.ones(graph.covariance.shape[1])
    if in_space and for_g2o:
        scale[3:] = 2.0
    edge = "EDGE_SE3:QUAT" if in_space else "EDGE_SE2"
    for start, end, relative, covariance in zip(
        graph.from_pose, graph.to_pose, graph.relative, graph.covariance, strict=True
    ):
        information = np.linalg.inv(covariance) * np.outer(scale, scale)
        yield f"{edge} {start} {end} {_cells(relative)} {_upper(information)}"
    edges = graph.landmark_edges
    tag, offset = ("EDGE_SE3_TRACKXYZ", f"{_OFFSET} ") if in_space else ("EDGE_SE2_XY", "")
    for pose, to, position, covariance in zip(
        edges.pose, edges.landmark, edges.position, edges.covariance, strict=True
    ):
        information = np.linalg.inv(covariance[:size, :size])
        cells = f"{_cells(position[:size])} {_upper(information)}"
        yield f"{tag} {pose} {first + to} {offset}{cells}"


def _upper(matrix: Floats) -> str:
    return _cells(matrix[np.triu_indices(len(matrix))])


def _cells(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
