"""A pose graph with landmarks, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints, as_covariances, as_floats, as_ints, assign, reject_rows
from dqslam._repr import counted
from dqslam.recording import as_poses, tangent_size


@dataclass(frozen=True, eq=False)
class LandmarkEdges:
    """Positions of landmarks in the frames of poses, one row each."""

    pose: Ints
    """Row of the pose, shape (m,)."""
    landmark: Ints
    """Row of the landmark, shape (m,)."""
    position: Floats
    """In the frame of the pose, meters, shape (m, 3)."""
    covariance: Floats
    """Square meters, shape (m, 3, 3)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        position = as_floats("landmark_edges.position", self.position, [None, 3])
        count = len(position)
        assign(
            self,
            pose=as_ints("landmark_edges.pose", self.pose, count),
            landmark=as_ints("landmark_edges.landmark", self.landmark, count),
            position=position,
            covariance=as_covariances("landmark_edges.covariance", self.covariance, count, 3),
        )

    def __len__(self) -> int:
        """Return the number of edges."""
        return len(self.position)


@dataclass(frozen=True, eq=False)
class PoseGraph:
    """Poses, relative poses between them, and objects as landmarks.

    d is the size of a pose (3 in SE(2), 7 in SE(3)), k that of its tangent (3, 6): translation [m]
    first, then rotation [rad], in the frame of the second pose of an edge.
    """

    pose_model: _core.PoseModel
    poses: Floats
    """Initial values, world_from_pose, shape (n, d)."""
    from_pose: Ints
    """Row of the first pose of each edge, shape (e,)."""
    to_pose: Ints
    """Row of the second pose, shape (e,)."""
    relative: Floats
    """to_in_from as measured, shape (e, d)."""
    covariance: Floats
    """In the tangent at ``relative``, shape (e, k, k)."""
    landmark_ids: Ints
    """Ids of the objects, shape (o,)."""
    landmarks: Floats
    """Their centers in the world, meters, shape (o, 3)."""
    landmark_edges: LandmarkEdges

    def __post_init__(self) -> None:
        """Check shapes and numbers, and that edges are of poses and landmarks that exist."""
        model = self.pose_model
        poses = as_poses("pose_graph.poses", self.poses, model)
        relative = as_poses("pose_graph.relative", self.relative, model)
        landmarks = as_floats("pose_graph.landmarks", self.landmarks, [None, 3])
        edges = self.landmark_edges
        assign(
            self,
            poses=poses,
            from_pose=as_ints("pose_graph.from_pose", self.from_pose, len(relative)),
            to_pose=as_ints("pose_graph.to_pose", self.to_pose, len(relative)),
            relative=relative,
            covariance=as_covariances(
                "pose_graph.covariance", self.covariance, len(relative), tangent_size(model)
            ),
            landmark_ids=as_ints("pose_graph.landmark_ids", self.landmark_ids, len(landmarks)),
            landmarks=landmarks,
        )
        for name, rows, count in (
            ("pose_graph.from_pose", self.from_pose, len(poses)),
            ("pose_graph.to_pose", self.to_pose, len(poses)),
            ("landmark_edges.pose", edges.pose, len(poses)),
            ("landmark_edges.landmark", edges.landmark, len(landmarks)),
        ):
            reject_rows(name, (rows < 0) | (rows >= count), f"no such row (of {count})", rows)

    def __repr__(self) -> str:
        """Show the pose model, and how many poses, edges and landmarks there are."""
        parts = [self.pose_model.name, counted(len(self.poses), "pose")]
        parts += [counted(len(self.relative), "edge"), counted(len(self.landmarks), "landmark")]
        return f"PoseGraph({', '.join(parts)})"


def rotations(model: _core.PoseModel, poses: Floats) -> tuple[Floats, Floats]:
    """Return world_from_pose rotations (n, 3, 3) and translations (n, 3) of poses (n, d)."""
    from scipy.spatial.transform import Rotation

    if model == _core.PoseModel.SE2:
        turn = Rotation.from_euler("z", poses[:, 2:]).as_matrix()
        return turn, np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return Rotation.from_quat(poses[:, 3:]).as_matrix(), poses[:, :3]
