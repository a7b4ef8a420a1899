"""Results with a cuboid, a cylinder and an ellipsoid around an orbiting camera.

All have the same half-lengths and turns of their own. The boxes are exact for sharp edges: those of
points of the surfaces.
"""

import numpy as np
from scipy.spatial.transform import Rotation

import orbit
from dqslam import Camera, _core
from dqslam._core import Shape
from dqslam.estimate import Estimate
from dqslam.io import save_estimate
from dqslam.recording import Detections
from dqslam.uncertainty import Marginals

CAMERA = Camera(*(orbit.CAMERA[name] for name in ("fx", "fy", "cx", "cy", "width", "height")))
SHAPES = (Shape.CUBOID, Shape.CYLINDER, Shape.ELLIPSOID)
CENTERS = np.array([[0.3, 0, 0], [0, 0.3, 0.1], [-0.3, 0, 0]])
HALF_LENGTHS = np.array([0.08, 0.05, 0.03])
TURNS = Rotation.from_rotvec([[0.1, 0.2, 0.3], [-0.2, 0.5, 1.0], [0.0, 0.0, 0.7]])
CLASSES = ("book", "can", "ball")
MOMENTS = (np.sqrt([5 / 3] * 3), np.sqrt([5 / 4, 5 / 4, 5 / 3]), np.ones(3))
POSES = 20
COVARIANCE = np.diag([1e-4, 4e-4, 9e-4, 0.01, 0.04, 0.09, 0.1, 0.1, 0.1])


def make_bodies() -> Estimate:
    truth = orbit.make_orbit(count=POSES)
    ellipsoids = np.array(
        [
            _core.ellipsoid_from_axes(center, HALF_LENGTHS * moments, turn.as_quat())
            for center, moments, turn in zip(CENTERS, MOMENTS, TURNS, strict=True)
        ]
    )
    landmarks = np.hstack(
        [CENTERS, np.tile(np.log(HALF_LENGTHS), (3, 1)), TURNS.as_rotvec().reshape(3, 3)]
    )
    landmarks[2] = ellipsoids[2]
    return Estimate(
        pose_model=_core.PoseModel.SE3,
        camera=CAMERA,
        timestamps=truth.times,
        poses=truth.poses,
        initial_poses=truth.poses,
        object_ids=np.array([3, 5, 8]),
        class_names=CLASSES,
        observations=np.full(3, POSES),
        dual_quadrics=np.array([_core.dual_quadric_from_ellipsoid(one) for one in ellipsoids]),
        ellipsoids=ellipsoids,
        landmarks=landmarks,
        object_shapes=SHAPES,
        inliers=np.ones(3 * POSES, dtype=bool),
    )


def surface(row):
    """Points of an object's surface, from the definitions of the unit solids."""
    along, angle = np.linspace(-1, 1, 5), np.linspace(0, 2 * np.pi, 181)
    if SHAPES[row] == Shape.CUBOID:
        u = np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3)
    elif SHAPES[row] == Shape.CYLINDER:
        u = np.array([[np.cos(a), np.sin(a), z] for a in angle for z in (-1.0, 1.0)])
    else:
        u = orbit.sphere(181)
    return TURNS[row].apply(u * HALF_LENGTHS) + CENTERS[row]


def pixels(row, pose):
    """The pixels of these points from a pose, shape (n, 2)."""
    points = Rotation.from_quat(pose[3:]).inv().apply(surface(row) - pose[:3])
    return points[:, :2] / points[:, 2:] * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy]


def make_boxes(estimate) -> Detections:
    pose = np.repeat(np.arange(POSES), 3)
    seen = [pixels(row, one) for one in estimate.poses for row in range(3)]
    return Detections(
        pose=pose,
        box=np.array([[*one.min(axis=0), *one.max(axis=0)] for one in seen]),
        score=np.ones(len(pose)),
        class_id=np.tile(np.arange(3), POSES),
        object_id=np.tile([3, 5, 8], POSES),
        class_names=dict(enumerate(CLASSES)),
    )


def write_bodies(folder) -> Estimate:
    """Write results into a folder, with covariances of objects and unknown ones of poses."""
    estimate = make_bodies()
    marginals = Marginals(np.full((POSES, 6, 6), np.nan), np.tile(COVARIANCE, (3, 1, 1)), ())
    boxes = make_boxes(estimate)
    save_estimate(estimate, folder, detections=boxes, marginals=marginals)
    return estimate


TRUE_OBJECTS = "object_id,class_name,x,y,z,qx,qy,qz,qw,sx,sy,sz\n" + "".join(
    ",".join([name, *(f"{value:.9f}" for value in (*center, *turn.as_quat(), *(2 * HALF_LENGTHS)))])
    + "\n"
    for name, center, turn in zip(("3,book", "5,can", "8,ball"), CENTERS, TURNS, strict=True)
)
