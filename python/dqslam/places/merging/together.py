"""Problems that folders of results have, and the maps and paths of their joint solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.io.results import GRAPH_FILE, read_graph
from dqslam.io.results.covariances import motion_of_camera
from dqslam.lens import camera_with
from dqslam.places.alignment.result import Alignment
from dqslam.places.landmarks import Landmarks, landmarks_of
from dqslam.places.merging.joint import JointMap, solve_together, why_apart

_SE3 = _core.PoseModel.SE3


@dataclass(frozen=True, eq=False)
class Solved:
    """A problem, its solution, and the options of the solver."""

    graph: Graph
    estimate: Estimate
    options: _core.SolveOptions


@dataclass(frozen=True, eq=False)
class Paths:
    """The poses of a joint solution, those of all recordings one after the other."""

    poses: Floats
    """World_from_camera, shape (n, 7)."""
    initial_poses: Floats
    """The same by odometry alone."""
    covariances: Floats
    """Of the poses in the frame of the camera, (n, 6, 6)."""


def solved_of(landmarks: Landmarks) -> tuple[Solved | None, str]:
    """Return the problem in the folder of a map; or None, and why it has none that can be used.

    Raises
    ------
    FileError
        If ``graph.npz`` is damaged.
    """
    results = landmarks.results
    if results is None:
        return None, f"{landmarks.name} is no folder of results"
    path = results.directory / GRAPH_FILE
    if not path.is_file():
        return None, f"{landmarks.name} has no {GRAPH_FILE}"
    saved = read_graph(path)
    kept = np.isfinite(saved.landmarks).all(axis=1)
    known = landmarks.object_ids[np.isfinite(landmarks.semi_axes).all(axis=1)]
    if len(results.poses) != saved.core.num_poses or not np.array_equal(
        saved.object_ids[kept], np.sort(known)
    ):
        return None, f"{path} is not of the map and the trajectory beside it"
    core = saved.core
    rows = np.flatnonzero(kept)
    estimate = Estimate(
        pose_model=core.pose_model,
        camera=core.camera if saved.lens is None else camera_with(core.camera, saved.lens),
        timestamps=saved.timestamps,
        poses=saved.poses,
        initial_poses=core.initial_poses,
        object_ids=saved.object_ids[rows],
        class_names=tuple(saved.class_names[row] for row in rows),
        observations=saved.observations[rows],
        dual_quadrics=np.array(
            [_core.dual_quadric_from_ellipsoid(saved.landmarks[row]) for row in rows]
        ).reshape(-1, 9),
        ellipsoids=saved.landmarks[rows],
    )
    graph = Graph(
        core=core,
        timestamps=saved.timestamps,
        object_ids=saved.object_ids,
        class_names=saved.class_names,
        observations=saved.observations,
        lens=saved.lens,
    )
    return Solved(graph, estimate, saved.options), ""


def why_not_together(first: Solved, second: Solved, found: Alignment) -> str:
    """Return why two problems are not solved as one, or nothing if they can be."""
    why = why_apart(first.graph, second.graph)
    plane = first.graph.core.pose_model == _core.PoseModel.SE2
    if not why and plane and found.motion != "se2":
        return "the poses are in the plane, and the motion between the maps is not"
    return why


def solve_maps(
    first: Solved, second: Solved, found: Alignment, name: str
) -> tuple[Solved, Landmarks, JointMap]:
    """Solve two problems as one; also return the map of the solution, of this name.

    Raises
    ------
    ValueError
        If the solution leaves an object or a pose undetermined.
    """
    joint = solve_together(
        (first.graph, first.estimate), (second.graph, second.estimate), found, first.options
    )
    if joint.marginals.under_constrained:
        raise ValueError(f"in one problem, {joint.marginals.under_constrained[0]}")
    landmarks = landmarks_of(joint.estimate, joint.marginals.objects, name=name)
    return Solved(joint.graph, joint.estimate, first.options), landmarks, joint


def paths_of(joint: JointMap) -> Paths:
    """Return the poses of the cameras."""
    estimate = joint.estimate
    model, camera = estimate.pose_model, estimate.camera
    moved = motion_of_camera(model, camera)
    return Paths(
        poses=_core.world_from_camera(model, camera, estimate.poses),
        initial_poses=_core.world_from_camera(model, camera, estimate.initial_poses),
        covariances=np.asarray(moved @ joint.marginals.poses @ moved.T),
    )


def motion_of_part(paths: Paths, own_poses: Floats, begin: int) -> tuple[Floats, Floats]:
    """Return merged_from_map (4, 4) of a recording, by its first pose, and its covariance (6, 6).

    Its poses alone are ``own_poses`` (n, 7), together they are the rows of ``paths`` from ``begin``
    on. The covariance is of a small motion in the merged frame.
    """
    from scipy.spatial.transform import Rotation

    there = paths.poses[begin : begin + 1]
    (motion,) = _core.compose(_SE3, there, _core.inverse(_SE3, own_poses[:1]))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(motion[3:]).as_matrix(), motion[:3]
    (adjoint,) = _core.adjoint(_SE3, there)
    return matrix, np.asarray(adjoint @ paths.covariances[begin] @ adjoint.T)


def joined_ids(joint: JointMap, second: Solved) -> tuple[Ints, Ints]:
    """Return the ids of the second map's objects, and of the same in the joint map, (p,) each."""
    mapped = np.isin(joint.merged_ids, joint.estimate.object_ids)
    return second.estimate.object_ids[mapped], joint.merged_ids[mapped]
