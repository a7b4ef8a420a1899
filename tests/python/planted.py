"""Results with planted errors: what an evaluation must find is known by hand.

Six objects around an orbiting camera. The truth is in another world than the estimate.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import orbit
from dqslam import Camera, _core
from dqslam.estimate import Estimate
from dqslam.io import save_estimate, write_trajectory
from dqslam.recording import Detections

TURN = Rotation.from_rotvec([0.3, -0.7, 1.1])
SHIFT = np.array([4.0, 5.0, 6.0])
CAMERA = Camera(*(orbit.CAMERA[name] for name in ("fx", "fy", "cx", "cy", "width", "height")))
CENTERS = np.array(
    [[0.3, 0, 0], [0, 0.3, 0.1], [-0.3, 0, 0], [0, -0.3, 0.1], [0.1, 0.1, 0.2], [-0.1, 0, -0.2]]
)
SEMI_AXES = np.array([0.08, 0.05, 0.03])
TURNS = Rotation.from_rotvec(np.arange(18.0).reshape(6, 3) / 10.0)
CLASSES = ("cup", "book", "lamp", "box", "box", "cup")
POSES = 20

# What is planted in the estimate.
CENTER_ERROR = 0.02  # meters, object 10
SIZE_FACTOR = 1.1  # object 11
ANGLE = 10.0  # degrees about the longest axis, object 12; 13 is not mapped; 14 moves


@dataclass
class Files:
    """Where everything is."""

    results: Path
    groundtruth: Path
    objects: Path
    boxes: Path


def write_planted(folder, scale=1.0, drift=0.0):
    """Write results, and the truth that is ``scale`` times as large; m of drift in odometry."""
    truth = orbit.make_orbit(count=POSES)
    poses = truth.poses
    turns = TURNS.as_quat()
    true = [_core.ellipsoid_from_axes(c, SEMI_AXES, t) for c, t in zip(CENTERS, turns, strict=True)]
    found = [
        _core.ellipsoid_from_axes(CENTERS[0] + [0, 0, CENTER_ERROR], SEMI_AXES, turns[0]),
        _core.ellipsoid_from_axes(CENTERS[1], SIZE_FACTOR * SEMI_AXES, turns[1]),
        _core.ellipsoid_from_axes(CENTERS[2], SEMI_AXES, _turned(TURNS[2]).as_quat()),
        true[4],
        _core.ellipsoid_from_axes([0, 0, 2], SEMI_AXES, turns[5]),  # invented
    ]
    ids = np.array([10, 11, 12, 14, 99])
    detections = _detections(poses, true)
    odometry = poses + np.linspace(0, drift, POSES)[:, None] * [1, 0, 0, 0, 0, 0, 0]
    inliers = np.arange(len(detections)) % 5 != 0
    estimate = Estimate(
        pose_model=_core.PoseModel.SE3,
        camera=CAMERA,
        timestamps=truth.times,
        poses=poses,
        initial_poses=odometry,
        object_ids=ids,
        class_names=("cup", "book", "lamp", "box", "cup"),
        observations=np.full(5, POSES),
        dual_quadrics=np.array([_core.dual_quadric_from_ellipsoid(one) for one in found]),
        ellipsoids=np.array(found),
        inliers=inliers[detections.pose % 4 != 3],
        dropped={13: "too few"},
    )
    files = Files(*(folder / name for name in ("out", "truth.txt", "objects.csv", "boxes_gt.csv")))
    held_out = detections.pose % 4 == 3
    save_estimate(estimate, files.results, detections=detections, held_out=held_out)
    positions = scale * TURN.apply(poses[:, :3]) + SHIFT
    rotations = (TURN * Rotation.from_quat(poses[:, 3:])).as_quat()
    write_trajectory(files.groundtruth, truth.times, np.hstack([positions, rotations]))
    _write_objects(files.objects, scale)
    _write_boxes(files.boxes, truth.times, detections)
    return files


def _turned(turn):
    return turn * Rotation.from_rotvec([np.radians(ANGLE), 0, 0])


def _detections(poses, ellipsoids):
    """Return the boxes of objects 10 to 14, pose by pose."""
    pose = np.repeat(np.arange(POSES), 5)
    boxes, in_front = _core.project_to_boxes(
        _core.PoseModel.SE3, CAMERA, poses[pose], np.tile(ellipsoids[:5], (POSES, 1))
    )
    assert in_front.all()
    return Detections(
        pose=pose,
        box=boxes,
        score=np.ones(len(pose)),
        class_id=np.tile(np.arange(5), POSES),
        object_id=np.tile(np.arange(10, 15), POSES),
        class_names=dict(enumerate(CLASSES[:5])),
    )


def _write_objects(path, scale):
    centers = scale * TURN.apply(CENTERS) + SHIFT
    lines = ["object_id,class_name,x,y,z,qx,qy,qz,qw,sx,sy,sz,static"]
    for row in range(6):
        numbers = [*centers[row], *(TURN * TURNS[row]).as_quat(), *(2 * scale * SEMI_AXES)]
        static = int(row != 4)
        cells = ",".join(repr(float(number)) for number in numbers)
        lines.append(f"{row + 10},{CLASSES[row]},{cells},{static}")
    path.write_text("\n".join(lines) + "\n")


def _write_boxes(path, times, detections):
    """Write the same boxes under other ids; object 12 becomes another half way."""
    lines = ["timestamp,x1,y1,x2,y2,track_id"]
    for pose, box, name in zip(detections.pose, detections.box, detections.object_id, strict=True):
        true = 50 if name == 12 and pose >= POSES // 2 else name + 20
        edges = ",".join(repr(float(edge)) for edge in box)
        lines.append(f"{float(times[pose])!r},{edges},{true}")
    path.write_text("\n".join(lines) + "\n")
