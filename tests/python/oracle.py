"""Independent brute force to test against: nothing here is shared with the package.

Poses become 4 x 4 matrices world_from_robot; surfaces are sampled and bounded by min and max.
"""

import numpy as np


def se2_matrix(pose):
    x, y, theta = pose
    matrix = np.eye(4)
    matrix[0, :2] = np.cos(theta), -np.sin(theta)
    matrix[1, :2] = np.sin(theta), np.cos(theta)
    matrix[:2, 3] = x, y
    return matrix


def quaternion_matrix(xyzw):
    """Rotation (3, 3) of a unit quaternion, by rotating the axes: v + 2 q x (q x v + w v)."""
    q, w = np.asarray(xyzw[:3]), xyzw[3]
    return np.column_stack([v + 2.0 * np.cross(q, np.cross(q, v) + w * v) for v in np.eye(3)])


def se3_matrix(pose):
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_matrix(pose[3:])
    matrix[:3, 3] = pose[:3]
    return matrix


def to_pixels(camera, world_from_robot, points):
    """Project world points (n, 3): pixels (n, 2) and depths (n,); no lens distortion."""
    world_from_camera = world_from_robot @ se3_matrix(camera.robot_from_camera)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    x, y, z, _ = np.linalg.inv(world_from_camera) @ homogeneous.T
    return np.column_stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy]), z


def bounding_box(camera, world_from_robot, points):
    """Box around projected points, None unless all are in front of the camera."""
    pixels, depth = to_pixels(camera, world_from_robot, points)
    if (depth <= 0.0).any():
        return None
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def ellipsoid_surface(center, semi_axes, xyzw, count=300):
    """Points (2 count^2, 3) all over an ellipsoid."""
    polar, azimuth = np.meshgrid(
        np.linspace(0.0, np.pi, count), np.linspace(-np.pi, np.pi, 2 * count, endpoint=False)
    )
    sphere = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    return center + (sphere * semi_axes) @ quaternion_matrix(xyzw).T


def cube_corners(center, side, yaw):
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * side / 2.0
    c, s = np.cos(yaw), np.sin(yaw)
    return center + corners @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
