"""Measurements of poses other than odometry: absolute positions, and loop closures."""

from dataclasses import dataclass

from dqslam._checks import Floats, Ints, as_covariances, as_floats, as_ints, assign, reject_rows
from dqslam._repr import counted
from dqslam.recording.poses import as_poses, pose_model_of, tangent_size


@dataclass(frozen=True, eq=False)
class AbsolutePositions:
    """Measured positions of the robot in a frame of their own, for example by GPS."""

    pose: Ints
    """Row of the pose that was measured, shape (a,)."""
    position: Floats
    """In the frame of the measurements, meters, shape (a, 3)."""
    covariance: Floats
    """In that frame, square meters, shape (a, 3, 3)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        position = as_floats("absolute.position", self.position, [None, 3])
        count = len(position)
        assign(
            self,
            pose=as_ints("absolute.pose", self.pose, count),
            position=position,
            covariance=as_covariances("absolute.covariance", self.covariance, count, 3),
        )

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.position)

    def __repr__(self) -> str:
        """Show how many measurements there are."""
        return f"AbsolutePositions({counted(len(self), 'position')})"


@dataclass(frozen=True, eq=False)
class LoopClosures:
    """Measured relative poses between any two poses."""

    from_pose: Ints
    """Row of the first pose, shape (c,)."""
    to_pose: Ints
    """Row of the second pose, shape (c,)."""
    relative: Floats
    """to_in_from, shape (c, d)."""
    covariance: Floats
    """In the tangent at ``relative``, translation [m] before rotation [rad], (c, k, k)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        model = pose_model_of("closures.relative", self.relative)
        relative = as_poses("closures.relative", self.relative, model)
        count = len(relative)
        from_pose = as_ints("closures.from_pose", self.from_pose, count)
        to_pose = as_ints("closures.to_pose", self.to_pose, count)
        reject_rows("closures.to_pose", from_pose == to_pose, "a pose closes with itself", to_pose)
        assign(
            self,
            from_pose=from_pose,
            to_pose=to_pose,
            relative=relative,
            covariance=as_covariances(
                "closures.covariance", self.covariance, count, tangent_size(model)
            ),
        )

    def __len__(self) -> int:
        """Return the number of closures."""
        return len(self.relative)

    def __repr__(self) -> str:
        """Show how many closures there are."""
        return f"LoopClosures({counted(len(self), 'closure')})"


def check_rows(name: str, rows: Ints, count: int) -> None:
    """Refuse rows of poses that do not exist."""
    reject_rows(name, (rows < 0) | (rows >= count), f"no such pose (there are {count})", rows)
