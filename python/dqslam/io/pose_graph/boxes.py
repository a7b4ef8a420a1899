"""Boxes as measured positions of landmarks, for programs that know no boxes.

With the shape of the object as estimated, a box measures the center by four edges. Linearized at
the estimate, with the residual r = measured - predicted box, its covariance S and the derivative J
of the predicted box by the center in the frame of the pose, that is the position

    z = center + (J^T S^-1 J)^-1 J^T S^-1 r    with the information    J^T S^-1 J.

The cost of z is that of the box, up to a constant and to terms of third order, while the object
does not turn in the frame of the pose.
"""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.io.pose_graph.graph import LandmarkEdges, rotations

# A box whose information along one direction is a smaller share of the largest says nothing there.
_LEAST_SHARE = 1e-9


def positions_of_boxes(
    model: _core.PoseModel,
    camera: _core.Camera,
    poses: Floats,
    ellipsoids: Floats,
    *,
    pose: Ints,
    landmark: Ints,
    box: Floats,
    covariance: Floats,
    used: Bools,
) -> LandmarkEdges:
    """Return boxes as positions.

    Parameters
    ----------
    poses, ellipsoids
        The estimate, shapes (n, d) and (o, 9).
    pose, landmark
        Rows of each box's pose and object, shape (m,).
    box, covariance
        Undistorted pixels, shape (m, 4), and square pixels, shape (m, 4, 4).
    used
        Which boxes to take, shape (m,): all four edges must have been measured. Boxes of objects
        that are not in front of the camera, or are no ellipsoids, are left out, too.
    """
    real: Bools = np.asarray(np.isfinite(ellipsoids).all(axis=1))
    rows = np.flatnonzero(used & real[landmark])
    here, objects = poses[pose[rows]], ellipsoids[landmark[rows]]
    predicted, in_front, jacobian = _core.differentiate_boxes(model, camera, here, objects)
    rows, here, objects = rows[in_front], here[in_front], objects[in_front]
    turn, origin = rotations(model, here)
    k = jacobian.shape[2] - 9
    by_center = jacobian[in_front][:, :, k : k + 3] @ turn
    weighted = np.linalg.solve(covariance[rows], by_center)
    information = by_center.transpose(0, 2, 1) @ weighted
    spread = np.linalg.eigvalsh(information)
    known = spread[:, 0] > _LEAST_SHARE * spread[:, 2]
    residual = box[rows] - predicted[in_front]
    gradient = np.einsum("mij,mi->mj", weighted, residual)
    inverse = np.linalg.inv(information[known])
    center = np.einsum("mji,mj->mi", turn, objects[:, :3] - origin)
    position = center[known] + np.einsum("mij,mj->mi", inverse, gradient[known])
    symmetric = 0.5 * (inverse + inverse.transpose(0, 2, 1))
    return LandmarkEdges(pose[rows[known]], landmark[rows[known]], position, symmetric)
