"""A map in the frame in which two maps are compared, and what its cameras saw of places."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.io import MapObjects, Results
from dqslam.io.results import ellipsoid_covariances
from dqslam.places.sensor import Sensor, learn_sensor
from dqslam.places.upright import find_up
from dqslam.places.visibility import view_objects

# Objects with fewer boxes than this do not enter a map.
FEWEST_BOXES = 3.0
# An object in view is not mapped for reasons that no look shows: it was joined with another, or
# was refused.
UNMAPPED = 0.02
# Objects nearer than this share of what both reach towards each other are within each other: sizes
# and centers have errors, and no object is an ellipsoid.
WITHIN = 0.75
# Images, at most, whose views are compared, evenly spaced.
_MOST_IMAGES = 400
_SE3 = _core.PoseModel.SE3


@dataclass(frozen=True, eq=False)
class SeenMap:
    """The ellipsoids of a map in the common frame, and the images that it was made from."""

    object_ids: Ints
    """Shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    centers: Floats
    """Meters, shape (o, 3)."""
    center_covariances: Floats
    """Shape (o, 3, 3)."""
    ellipsoids: Floats
    """Shape (o, 9)."""
    log_size: Floats
    """Mean logarithm of the semi-axes, and its sigma, shape (o, 2)."""
    log_axes: Floats
    """Logarithms of the semi-axes, descending, shape (o, 3)."""
    log_axes_sigmas: Floats
    """Their sigmas, shape (o, 3)."""
    sensor: Sensor | None
    """None without boxes: nobody knows then where the cameras looked."""
    camera: _core.Camera
    poses: Floats
    """Of the images with boxes, common_from_camera, shape (n, 7)."""
    up: Floats | None
    """The direction up, if the cameras show it, shape (3,)."""
    image_share: float
    """Images that were taken, for each of these."""

    @classmethod
    def of(cls, results: Results, common_from_map: Floats) -> Self:
        """Move a map by a pose (7,) into the common frame.

        Raises
        ------
        ValueError
            If the map has no ellipsoid.
        """
        objects = results.objects
        rows = np.flatnonzero(objects.is_ellipsoid)
        if not rows.size:
            raise ValueError(f"{results.directory / 'map.json'}: has no ellipsoid")
        poses = np.zeros((0, 7))
        sensor, share = None, 1.0
        names = tuple(objects.class_names[row] for row in rows)
        if results.boxes is not None and len(results.boxes):
            sensor = learn_sensor(
                results.camera,
                results.poses,
                results.boxes,
                objects.object_ids[rows],
                names,
                objects.ellipsoids[rows],
            )
            images = np.unique(results.boxes.pose)
            step = -(-len(images) // _MOST_IMAGES)
            chosen = results.poses[images[::step]]
            share = len(images) / len(chosen)
            poses = _core.compose(_SE3, np.tile(common_from_map, (len(chosen), 1)), chosen)
        upright = find_up(poses)
        moved = _moved(objects, rows, common_from_map)
        covariances = ellipsoid_covariances(moved, np.arange(len(rows)))
        sigmas = np.nan_to_num(moved.log_semi_axes_sigmas, nan=0.1)
        sigma = np.sqrt((sigmas**2).sum(axis=1)) / 3
        return cls(
            object_ids=moved.object_ids,
            class_names=names,
            centers=moved.centers,
            center_covariances=covariances[:, :3, :3],
            ellipsoids=moved.ellipsoids,
            log_size=np.column_stack([np.log(moved.semi_axes).mean(axis=1), sigma]),
            log_axes=np.log(moved.semi_axes),
            log_axes_sigmas=sigmas,
            sensor=sensor,
            camera=results.camera,
            poses=poses,
            up=None if upright is None else upright.up,
            image_share=share,
        )

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.object_ids)

    def within_each_other(self) -> Bools:
        """Return which objects of one class are so near that they reach into each other, (o, o).

        Solid things do not: such a pair is most often one thing that is mapped twice.
        """
        apart = self.centers[None] - self.centers[:, None]
        distance = np.linalg.norm(apart, axis=2)
        direction = apart / np.maximum(distance, 1e-12)[:, :, None]
        inverse = np.linalg.inv(_core.ellipsoid_shapes(self.ellipsoids))
        # How far each object reaches towards each other one.
        square = np.einsum("abi,aij,abj->ab", direction, inverse, direction)
        reach = np.maximum(square, 1e-12) ** -0.5
        names = np.array(self.class_names)
        near = distance < WITHIN * (reach + reach.T)
        return np.asarray(near & (names[:, None] == names) & ~np.eye(len(names), dtype=np.bool_))

    def looks_at(self, other: SeenMap) -> Floats:
        """Return how many boxes the objects of another map should have had here, shape (o,).

        Objects of this map may have hidden them. Their apparent size decides how often this
        detector finds objects, and the other map's boxes how often it finds each of them.
        """
        if self.sensor is None or not len(self.poses):
            return np.zeros(len(other))
        both = np.vstack([other.ellipsoids, self.ellipsoids])
        hides = np.arange(len(both)) >= len(other)
        shift = np.zeros(len(both))
        if other.sensor is not None:
            shift[: len(other)] = np.minimum(other.sensor.rate_shift, 0.0)
        sensor = replace(self.sensor, rate_shift=shift)
        expected = np.zeros(len(other))
        for part in np.array_split(self.poses, max(1, len(self.poses) // 50)):
            rate = sensor.detection_rate(view_objects(self.camera, part, both, hides))
            expected += rate[:, : len(other)].sum(axis=0)
        return np.asarray(expected * self.image_share)


def missed(expected: Floats) -> Floats:
    """Return the probability that an object is not mapped where it should have so many boxes."""
    from scipy.special import pdtr

    return np.asarray(UNMAPPED + (1.0 - UNMAPPED) * pdtr(FEWEST_BOXES - 1.0, expected))


def _moved(objects: MapObjects, rows: Ints, pose: Floats) -> MapObjects:
    """Return some objects of a map, moved by a pose (7,)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(pose[3:])
    matrix = turn.as_matrix()
    quaternions = (turn * Rotation.from_quat(objects.orientations[rows])).as_quat()
    return replace(
        objects,
        object_ids=objects.object_ids[rows],
        class_names=tuple(objects.class_names[row] for row in rows),
        centers=turn.apply(objects.centers[rows]) + pose[:3],
        semi_axes=objects.semi_axes[rows],
        orientations=np.reshape(quaternions, (-1, 4)),
        dual_quadrics=objects.dual_quadrics[rows],
        observations=objects.observations[rows],
        center_covariances=matrix @ objects.center_covariances[rows] @ matrix.T,
        log_semi_axes_sigmas=objects.log_semi_axes_sigmas[rows],
    )
