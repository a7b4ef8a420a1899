"""A small place for tests of localization: objects on a table, boxes by brute force.

It shares no code with the package: boxes are the extremes of points on the surfaces.
"""

import json
import shutil

import numpy as np
from scipy.spatial.transform import Rotation

import dqslam as dq
from orbit import CAMERA, bounding_box, looking_at_origin, sphere

NAMES = ("cup", "book", "lamp", "cup", "bowl", "book", "cup", "plant")
CENTERS = np.array(
    [
        [0.0, 0.0, 0.1],
        [0.9, 0.2, 0.05],
        [0.5, 0.8, 0.3],
        [-0.7, 0.4, 0.1],
        [-0.4, -0.8, 0.1],
        [0.3, -0.6, 0.05],
        [-0.9, -0.3, 0.2],
        [0.1, 1.1, 0.4],
    ]
)
AXES = {
    "cup": (0.06, 0.05, 0.05),
    "book": (0.16, 0.11, 0.04),
    "lamp": (0.2, 0.1, 0.1),
    "bowl": (0.1, 0.1, 0.05),
    "plant": (0.25, 0.2, 0.15),
}
LENS = dq.Camera(**CAMERA)


def turns(count):
    """Return a turn for each object, the same at each call."""
    return Rotation.random(count, random_state=5)


def pose_at(x, y, z):
    """Return world_from_camera of a camera that looks at the middle of the table."""
    position = np.array([x, y, z], dtype=float)
    return np.concatenate([position, Rotation.from_matrix(looking_at_origin(position)).as_quat()])


def boxes_at(pose, centers=CENTERS, names=NAMES, noise_px=0.0, seed=0):
    """Return the boxes (o, 4) of all objects from a pose."""
    random, world_from_camera = np.random.default_rng(seed), Rotation.from_quat(pose[3:])
    rotations = turns(len(names)).as_matrix()
    found = []
    for center, name, turn in zip(centers, names, rotations, strict=True):
        surface = center + (sphere() * AXES[name]) @ turn.T
        inside = (surface - pose[:3]) @ world_from_camera.as_matrix()
        found.append(bounding_box(inside) + random.normal(0.0, noise_px, 4))
    return np.array(found)


def detections_of(boxes, names=NAMES, pose=0):
    """Return boxes of one image, of classes by name."""
    known = sorted(set(names))
    return dq.Detections(
        pose=np.broadcast_to(pose, len(boxes)),
        box=boxes,
        score=np.ones(len(boxes)),
        class_id=np.array([known.index(name) for name in names]),
        object_id=np.full(len(boxes), -1),
        class_names=dict(enumerate(known)),
    )


def circle(count):
    """Return poses around the table."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.array([pose_at(2.5 * np.cos(a), 2.5 * np.sin(a), 1.2) for a in angle])


def write_map(folder, centers=CENTERS, names=NAMES, poses=None, sigma_m=0.005, with_boxes=True):
    """Write a folder of results, with the boxes of a circle around the table."""
    poses = circle(24) if poses is None else poses
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "camera.json").write_text(json.dumps(CAMERA))
    lines = [f"{i} " + " ".join(f"{x:.12f}" for x in pose) for i, pose in enumerate(poses)]
    for name in ("trajectory.txt", "odometry.txt"):
        (folder / name).write_text("\n".join(lines) + "\n")
    objects = [
        {
            "id": 10 + row,
            "class_name": name,
            "center": list(center),
            "semi_axes": list(AXES[name]),
            "orientation_xyzw": turn.tolist(),
            "observations": len(poses),
            "center_covariance": (sigma_m**2 * np.eye(3)).tolist(),
            "log_semi_axes_sigma": [0.03] * 3,
        }
        for row, (center, name, turn) in enumerate(
            zip(centers, names, turns(len(names)).as_quat(), strict=True)
        )
    ]
    (folder / "map.json").write_text(json.dumps({"objects": objects, "dropped": []}))
    if with_boxes:
        rows = [
            "timestamp,x1,y1,x2,y2,truncated,score,class_id,class_name,object_id,inlier,held_out"
        ]
        for image, pose in enumerate(poses):
            boxes = boxes_at(pose, centers, names, noise_px=1.0, seed=image)
            for row, (box, name) in enumerate(zip(boxes, names, strict=True)):
                edges = ",".join(f"{x:.6f}" for x in box)
                rows.append(
                    f"{image},{edges},,1,{sorted(set(names)).index(name)},{name},{10 + row},1,0"
                )
        (folder / "boxes.csv").write_text("\n".join(rows) + "\n")
    return folder


def write_turned(before, folder):
    """Copy a folder of results into another frame; also return the motion into it, (4, 4)."""
    turn, shift = Rotation.from_euler("z", 40, degrees=True), np.array([1.0, -2.0, 0.3])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn.as_matrix(), shift
    poses = dq.load_results(before).poses
    shutil.copytree(before, folder)
    content = json.loads((before / "map.json").read_text())
    for one in content["objects"]:
        one["center"] = (turn.apply(one["center"]) + shift).tolist()
        turned = turn * Rotation.from_quat(one["orientation_xyzw"])
        one["orientation_xyzw"] = turned.as_quat().tolist()
    (folder / "map.json").write_text(json.dumps(content))
    moved = [
        [*(turn.apply(p[:3]) + shift), *(turn * Rotation.from_quat(p[3:])).as_quat()] for p in poses
    ]
    lines = [f"{i} " + " ".join(f"{x:.9f}" for x in pose) for i, pose in enumerate(moved)]
    for name in ("trajectory.txt", "odometry.txt"):
        (folder / name).write_text("\n".join(lines) + "\n")
    return folder, matrix
