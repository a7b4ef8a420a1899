"""A small recording of our own: a camera circles a table with ellipsoids on it.

Everything is plain numpy and brute force, so that it does not share a mistake with the package.
"""

import json
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

CAMERA = {"fx": 500.0, "fy": 510.0, "cx": 321.0, "cy": 239.0, "width": 640, "height": 480}
NAMES = {1: "cup", 2: "book", 5: "lamp", 9: "box"}


@dataclass
class Orbit:
    """Truth: poses (n, 7) world_from_camera at times (n,), centers (o, 3), boxes by pose, id."""

    times: np.ndarray
    poses: np.ndarray
    centers: dict[int, np.ndarray]
    semi_axes: dict[int, np.ndarray]
    boxes: dict[tuple[int, int], np.ndarray]


def make_orbit(count=40, noise_px=0.0, seed=0):
    """Circle once at 1.2 m, looking at the middle; every object is in every image."""
    random = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    position = np.column_stack(
        [1.2 * np.cos(angle), 1.2 * np.sin(angle), 0.7 + 0.2 * np.sin(3 * angle)]
    )
    rotations = [looking_at_origin(point) for point in position]
    poses = np.hstack([position, [Rotation.from_matrix(r).as_quat() for r in rotations]])
    centers, semi_axes, boxes = {}, {}, {}
    for i, name in enumerate(NAMES):
        centers[name] = np.array([0.25 * np.cos(1.6 * i), 0.25 * np.sin(1.6 * i), 0.03 * i])
        semi_axes[name] = random.uniform(0.04, 0.1, 3)
        turn = Rotation.random(random_state=random).as_matrix()
        surface = centers[name] + sphere() * semi_axes[name] @ turn.T
        for pose, rotation in enumerate(rotations):
            box = bounding_box((surface - position[pose]) @ rotation)
            boxes[pose, name] = box + random.normal(0, noise_px, 4)
    return Orbit(100 + 0.1 * np.arange(count), poses, centers, semi_axes, boxes)


def looking_at_origin(position):
    """Return world_from_camera: z towards the origin, y down."""
    z = -position / np.linalg.norm(position)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def sphere(count=60):
    """Return points all over a unit sphere."""
    u, v = np.meshgrid(np.linspace(0, np.pi, count), np.linspace(0, 2 * np.pi, 2 * count))
    return np.column_stack(
        [(np.sin(u) * np.cos(v)).ravel(), (np.sin(u) * np.sin(v)).ravel(), np.cos(u).ravel()]
    )


def bounding_box(points):
    """Project points in the camera frame and return u_min, v_min, u_max, v_max."""
    u = CAMERA["fx"] * points[:, 0] / points[:, 2] + CAMERA["cx"]
    v = CAMERA["fy"] * points[:, 1] / points[:, 2] + CAMERA["cy"]
    return np.array([u.min(), v.min(), u.max(), v.max()])


def write_orbit(folder, orbit):
    """Write camera.json, traj.txt and boxes.csv; return their paths."""
    camera, trajectory, boxes = (folder / name for name in ("camera.json", "traj.txt", "boxes.csv"))
    camera.write_text(json.dumps(CAMERA))
    rows = np.column_stack([orbit.times, orbit.poses])
    trajectory.write_text("".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist()))
    lines = ["frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id"]
    for (pose, name), box in orbit.boxes.items():
        edges = ",".join(map(repr, box.tolist()))
        time = orbit.times[pose].item()
        lines.append(f"{pose},{time!r},{edges},0.9,{name},{NAMES[name]},{name + 100}")
    boxes.write_text("\n".join(lines) + "\n")
    return camera, trajectory, boxes
