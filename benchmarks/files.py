"""Problems as files: what every program reads."""

from pathlib import Path

import numpy as np

from benchmarks.problems import BOX_SIGMA_PX, Problem
from dqslam import Camera, Detections, Odometry, Recording, _core
from dqslam._checks import Floats
from dqslam._core import PoseModel


def save_problem(problem: Problem, path: str | Path) -> None:
    """Write a planar problem, without its truth, as arrays that peers can read.

    Beside the recording's own: `intrinsics` fx fy cx cy, `camera_poses` (n, 4, 4) and
    `camera_steps` (n - 1, 4, 4), world_from_camera by dead reckoning and next_in_previous,
    `object_row` (b,) of each box in `start_centers` (o, 3).
    """
    recording = problem.recording
    camera, odometry, boxes = recording.camera, recording.odometry, recording.detections
    reckoned = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    seen_from = _core.world_from_camera(odometry.pose_model, camera, reckoned)
    steps = _core.between(PoseModel.SE3, seen_from[:-1], seen_from[1:])
    np.savez(
        path,
        image_size=np.array([camera.width, camera.height]),
        robot_from_camera=camera.robot_from_camera,
        timestamps=recording.timestamps,
        first_pose=odometry.first_pose,
        relative=odometry.relative,
        covariance=odometry.covariance,
        pose=boxes.pose,
        box=boxes.box,
        object_id=boxes.object_id,
        intrinsics=np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
        box_sigma_px=BOX_SIGMA_PX,
        camera_in_robot=_matrices(camera.robot_from_camera[None])[0],
        camera_poses=_matrices(seen_from),
        camera_steps=_matrices(steps),
        object_row=np.unique(boxes.object_id, return_inverse=True)[1],
        start_centers=problem.peer_centers,
    )


def load_problem(path: str | Path) -> tuple[Recording, Floats]:
    """Read the recording of a problem, and the centers where peers start its objects, (o, 3)."""
    with np.load(path) as arrays:
        count = len(arrays["box"])
        recording = Recording(
            camera=Camera(
                *arrays["intrinsics"].tolist(),
                *arrays["image_size"].tolist(),
                robot_from_camera=arrays["robot_from_camera"],
            ),
            timestamps=arrays["timestamps"],
            odometry=Odometry(
                PoseModel.SE2, arrays["first_pose"], arrays["relative"], arrays["covariance"]
            ),
            detections=Detections(
                pose=arrays["pose"],
                box=arrays["box"],
                score=np.ones(count),
                class_id=np.zeros(count, dtype=np.int64),
                object_id=arrays["object_id"],
                class_names={0: "ellipsoid"},
            ),
        )
        return recording, arrays["start_centers"]


def _matrices(poses: Floats) -> Floats:
    """Write SE(3) poses (n, 7) as matrices (n, 4, 4)."""
    from scipy.spatial.transform import Rotation

    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(poses[:, 3:]).as_matrix()
    matrices[:, :3, 3] = poses[:, :3]
    return matrices
