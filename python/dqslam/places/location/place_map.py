"""A map that is ready for the search for a camera, and an image's boxes compared with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.assumptions import BoxNoise
from dqslam.io import MapObjects, Results
from dqslam.io.results import ellipsoid_covariances
from dqslam.io.results.map_covariances import UNKNOWN_LOG_SIGMA
from dqslam.lens import cut_edges
from dqslam.places.landmarks import Landmarks
from dqslam.places.location.boxes import LabeledBoxes
from dqslam.places.sensor import Sensor, assumed_sensor, learn_sensor
from dqslam.places.upright import Upright, find_up

# Sight in a map without boxes, in mean sizes of its objects.
_ASSUMED_SIGHT = 40.0
# Spread of the apparent size that does not come from the axes of the ellipsoid.
_SIZE_SIGMA = 0.1
# The ratio of the axes, as a logarithm, that becomes a part of that spread.
_ASPECT_SHARE = 0.3
# What is in view is around a point at this share of the sight ahead, within this share of it, and
# is so many objects at most; objects around which they are counted.
AHEAD, REACH, MOST_OBJECTS, _MOST_SAMPLES = 0.4, 0.6, 200, 500
# Directions from which the map saw an object, at most.
_MOST_DIRECTIONS = 32


@dataclass(frozen=True, eq=False)
class PlaceMap:
    """The ellipsoids of a map, and what its detector does with them."""

    object_ids: Ints
    """Shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    ellipsoids: Floats
    """Shape (o, 9)."""
    covariances: Floats
    """Of the ellipsoids, shape (o, 9, 9)."""
    sensor: Sensor
    upright: Upright | None
    """Which way is up, if the map's own cameras show it."""
    seen_from: Floats
    """Directions from each object to cameras that saw it, unit vectors, shape (o, d, 3).

    NaN where there are fewer; d is 0 without boxes.
    """

    @classmethod
    def of(cls, results: Results) -> Self:
        """Prepare the map of a result folder.

        Raises
        ------
        ValueError
            If the map has no ellipsoid.
        """
        objects = results.objects
        rows = np.flatnonzero(objects.is_ellipsoid)
        if not rows.size:
            raise ValueError(f"{results.directory / 'map.json'}: has no ellipsoid")
        names = tuple(objects.class_names[row] for row in rows)
        ellipsoids, ids = objects.ellipsoids[rows], objects.object_ids[rows]
        if results.boxes is None or not len(results.boxes):
            size = float(np.mean(objects.semi_axes[rows]))
            sensor = assumed_sensor(names, _ASSUMED_SIGHT * size)
        else:
            sensor = learn_sensor(
                results.camera, results.poses, results.boxes, ids, names, ellipsoids
            )
        return cls(
            object_ids=ids,
            class_names=names,
            ellipsoids=ellipsoids,
            covariances=ellipsoid_covariances(objects, rows),
            sensor=sensor,
            upright=find_up(results.poses),
            seen_from=_seen_from(results, ids, ellipsoids),
        )

    @classmethod
    def of_objects(
        cls,
        object_ids: Ints,
        class_names: tuple[str, ...],
        ellipsoids: Floats,
        covariances: Floats,
        *,
        box_noise: BoxNoise | None = None,
        upright: Upright | None = None,
    ) -> Self:
        """Prepare ellipsoids (o, 9) alone, of covariances (o, 9, 9).

        Rates of detection are assumed, and so is the noise of boxes unless it is given.
        """
        shapes = _core.ellipsoid_shapes(ellipsoids)
        size = float(np.sqrt(np.linalg.eigvalsh(shapes)).mean())
        sensor = assumed_sensor(class_names, _ASSUMED_SIGHT * size)
        return cls(
            object_ids=object_ids,
            class_names=class_names,
            ellipsoids=ellipsoids,
            covariances=covariances,
            sensor=sensor if box_noise is None else replace(sensor, noise=box_noise),
            upright=upright,
            seen_from=np.full((len(ellipsoids), 0, 3), np.nan),
        )

    @classmethod
    def of_landmarks(cls, landmarks: Landmarks) -> Self:
        """Prepare objects alone, of a CSV or a ``map.json``: rates of detection are assumed.

        An object of unknown orientation is a sphere of its mean semi-axis, whose size is as
        uncertain as its axes differ.

        Raises
        ------
        ValueError
            If no object has a size, which its distance is known by.
        """
        rows = np.flatnonzero(np.isfinite(landmarks.semi_axes).all(axis=1))
        if not rows.size:
            raise ValueError(f"{landmarks.name}: no object has a size, which tells its distance")
        axes, turns = landmarks.semi_axes[rows].copy(), landmarks.orientations[rows].copy()
        sigmas = landmarks.log_semi_axes_sigmas[rows].copy()
        sigmas[~np.isfinite(sigmas)] = UNKNOWN_LOG_SIGMA
        is_turned = np.isfinite(turns).all(axis=1)
        logs = np.log(axes[~is_turned])
        axes[~is_turned] = np.exp(logs.mean(axis=1, keepdims=True))
        sigmas[~is_turned] = np.hypot(sigmas[~is_turned], logs.std(axis=1, keepdims=True))
        turns[~is_turned] = [0.0, 0.0, 0.0, 1.0]
        objects = MapObjects(
            object_ids=landmarks.object_ids[rows],
            class_names=tuple(landmarks.class_names[row] for row in rows),
            centers=landmarks.centers[rows],
            semi_axes=axes,
            orientations=turns,
            dual_quadrics=np.full((len(rows), 9), np.nan),
            observations=landmarks.observations[rows],
            center_covariances=landmarks.covariances[rows],
            log_semi_axes_sigmas=sigmas,
        )
        return cls.of_objects(
            objects.object_ids,
            objects.class_names,
            objects.ellipsoids,
            ellipsoid_covariances(objects, np.arange(len(rows))),
        )

    @cached_property
    def tree(self) -> Any:
        """The centers of the objects, for search by place."""
        from scipy.spatial import cKDTree

        return cKDTree(self.ellipsoids[:, :3])

    @cached_property
    def in_reach(self) -> int:
        """How many objects around a point ahead of a camera may be in its sight, 200 at most.

        That is the number within ``REACH`` of the sight around an object, which one in twenty
        exceeds.
        """
        centers = self.ellipsoids[:, :3]
        some = centers[:: -(-len(centers) // _MOST_SAMPLES)]
        radius = REACH * self.sensor.sight
        counts = self.tree.query_ball_point(some, radius, return_length=True)
        return min(int(np.quantile(counts, 0.95)) + 1, MOST_OBJECTS, len(centers))

    @cached_property
    def size(self) -> Floats:
        """Logarithm of the radius of the sphere that looks as large, and its sigma; (o, 2)."""
        shapes = _core.ellipsoid_shapes(self.ellipsoids)
        logs = 0.5 * np.log(np.linalg.eigvalsh(shapes))
        aspect = _ASPECT_SHARE * (logs[:, 2] - logs[:, 0])
        spread = np.sqrt(np.diagonal(self.covariances[:, 3:, 3:], axis1=1, axis2=2).sum(axis=1)) / 3
        return np.column_stack([logs.mean(axis=1), np.hypot(np.hypot(_SIZE_SIGMA, aspect), spread)])

    def new_view(self, rows: Ints, position: Floats) -> Floats:
        """Return angles (m,) between views of objects (m,) from positions (m, 3) and the map's.

        That is to the nearest view of the map. 0 if these are not known.
        """
        if not self.seen_from.shape[1]:
            return np.zeros(len(rows))
        direction = position - self.ellipsoids[rows, :3]
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        cosine = np.einsum("mdi,mi->md", self.seen_from[rows], direction)
        best = np.fmax.reduce(cosine, axis=1, initial=-1.0)
        known = np.isfinite(cosine[:, 0])
        return np.where(known, np.arccos(np.clip(best, -1.0, 1.0)), 0.0)

    @cached_property
    def volume(self) -> float:
        """Cubic meters in which a camera may be: the box around the objects and half a sight."""
        extent = np.ptp(self.ellipsoids[:, :3], axis=0) + self.sensor.sight
        return float(extent.prod())


def _seen_from(results: Results, ids: Ints, ellipsoids: Floats) -> Floats:
    found = np.full((len(ids), 0, 3), np.nan)
    if results.boxes is None:
        return found
    found = np.full((len(ids), _MOST_DIRECTIONS, 3), np.nan)
    for row, number in enumerate(ids.tolist()):
        poses = results.boxes.pose[results.boxes.object_id == number]
        poses = poses[:: -(-max(len(poses), 1) // _MOST_DIRECTIONS)]
        direction = results.poses[poses, :3] - ellipsoids[row, :3]
        found[row, : len(poses)] = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return found


@dataclass(frozen=True, eq=False)
class ImageBoxes:
    """The boxes of one image, compared with the labels of the objects."""

    box: Floats
    """Undistorted pixels, shape (b, 4)."""
    covariance: Floats
    """Of the edges [px^2], shape (b, 4, 4)."""
    truncated: Bools
    """Edges that the border of the image cut, shape (b, 4)."""
    log_label: Floats
    """Logarithm of the probability of each box's labels if it shows an object, shape (b, o)."""
    log_false: Floats
    """Logarithm of the density of each box if it shows none, with its rate, shape (b,)."""
    log_elsewhere: float
    """Log-odds of an image of another place against one that shows none of the objects here.

    In another place there are objects, too: as many boxes as usual, not as many as are false.
    """

    @classmethod
    def of(
        cls,
        place: PlaceMap,
        camera: _core.Camera,
        labeled: LabeledBoxes,
    ) -> Self:
        """Compare boxes and the weights of their labels with a map."""
        box, labels = labeled.box, labeled.labels
        sensor, count = place.sensor, len(place.sensor.labels)
        column = {name: row for row, name in enumerate(sensor.labels)}
        weight = np.zeros((len(box), count + 1))
        for row, names in enumerate(labels):
            total = sum(names.values())
            for name, share in names.items():
                weight[row, column.get(name, count)] += share / total
        # A label that no object ever had is as likely as the least of the others.
        unknown = sensor.log_label.min(axis=1, keepdims=True)
        table = np.exp(np.hstack([sensor.log_label, unknown]))
        cut = labeled.truncated | cut_edges(camera, box)
        false = np.log(weight @ np.exp(sensor.log_false_label) * sensor.false_boxes)
        other = np.log(weight @ np.exp(sensor.log_any_label) * sensor.all_boxes)
        return cls(
            box=box,
            covariance=sensor.box_covariance(box, labeled.score, camera),
            truncated=cut,
            log_label=np.log(weight @ table.T),
            log_false=false + _log_density(camera, box, cut),
            log_elsewhere=float(np.sum(other - false) - sensor.all_boxes + sensor.false_boxes),
        )


def _log_density(camera: _core.Camera, box: Floats, truncated: Bools) -> Floats:
    """Return the logarithm of the density of a box anywhere in the image, of its free edges.

    Its middle is anywhere, and each scale of its sides as likely as any other.
    """
    side = box[:, 2:] - box[:, :2]
    image = np.array([camera.width, camera.height])
    each = -np.log(image) - np.log(side * np.log(image))
    free = 1.0 - 0.5 * (truncated[:, :2].astype(float) + truncated[:, 2:])
    return np.asarray((free * each).sum(axis=1))
