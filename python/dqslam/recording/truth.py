"""The truth of a simulation."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints, as_floats, as_ints, assign, reject_rows
from dqslam._core import PoseModel
from dqslam._repr import counted
from dqslam.recording.poses import as_poses


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth of a simulation, for evaluation only."""

    pose_model: PoseModel
    poses: Floats
    """world_from_robot, shape (n, d)."""
    object_ids: Ints
    """Ids of all objects of the world, detected or not; shape (o,)."""
    centers: Floats
    """Centers in the world, meters, shape (o, 3)."""
    volumes: Floats
    """Cubic meters, shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    ellipsoids: Floats | None = None
    """Center and log-Cholesky shape, shape (o, 9); None if the objects are no ellipsoids."""
    cuboids: Floats | None = None
    """Center, half the sides, and world_from_object as a quaternion, of cuboids with three
    different sides; shape (o, 10)."""
    box_object_id: Ints | None = None
    """True object of each box of the recording, independent of its id; -1 for none; shape (m,)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        object_ids = as_ints("truth.object_ids", self.object_ids)
        count = len(object_ids)
        if len(set(object_ids.tolist())) != count:
            raise ValueError("truth.object_ids: an id occurs twice")
        if len(self.class_names) != count:
            raise ValueError(f"truth.class_names: expected {count}, got {len(self.class_names)}")
        volumes = as_floats("truth.volumes", self.volumes, [count])
        reject_rows("truth.volumes", volumes <= 0.0, "not positive", volumes)
        ellipsoids = self.ellipsoids
        if ellipsoids is not None:
            ellipsoids = as_floats("truth.ellipsoids", ellipsoids, [count, 9])
        cuboids = self.cuboids
        if cuboids is not None:
            cuboids = as_floats("truth.cuboids", cuboids, [count, 10])
        box_object_id = self.box_object_id
        if box_object_id is not None:
            box_object_id = as_ints("truth.box_object_id", box_object_id)
            unknown = ~np.isin(box_object_id, [-1, *object_ids])
            reject_rows("truth.box_object_id", unknown, "no such object", box_object_id)
        assign(
            self,
            poses=as_poses("truth.poses", self.poses, self.pose_model),
            object_ids=object_ids,
            centers=as_floats("truth.centers", self.centers, [count, 3]),
            volumes=volumes,
            class_names=tuple(self.class_names),
            ellipsoids=ellipsoids,
            cuboids=cuboids,
            box_object_id=box_object_id,
        )

    def __repr__(self) -> str:
        """Show how many poses and objects there are."""
        objects = counted(len(self.object_ids), "object")
        return f"Truth({self.pose_model.name}, {counted(len(self.poses), 'pose')}, {objects})"
