"""The result of an estimator, as plain data."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam._core import (
    Camera,
    PoseModel,
    Shape,
    axes_from_ellipsoid,
    dual_quadric_shapes,
    log_semi_axes_jacobian,
)
from dqslam._repr import counted
from dqslam.solids import MOMENTS, Solids, body_solids
from dqslam.track import Track


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated poses and objects, and the initial poses.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> estimate, summary = dq.solve(dq.build_graph(recording))
    >>> estimate.poses.shape, estimate.centers.shape, estimate.semi_axes.shape
    ((253, 3), (10, 3), (10, 3))
    >>> dict(zip(estimate.object_ids.tolist(), estimate.class_names))[4]
    'cube'
    """

    pose_model: PoseModel
    camera: Camera
    timestamps: Floats
    """Seconds, shape (n,)."""
    poses: Floats
    """world_from_robot, shape (n, d)."""
    initial_poses: Floats
    """world_from_robot by odometry alone, shape (n, d)."""
    object_ids: Ints
    """Ids of the mapped objects, ascending, shape (o,)."""
    class_names: tuple[str, ...]
    """One per mapped object."""
    observations: Ints
    """Number of boxes of each mapped object, shape (o,)."""
    dual_quadrics: Floats
    """q1 .. q9 with Q*(4,4) = 1, shape (o, 9)."""
    ellipsoids: Floats
    """Center and log-Cholesky shape, shape (o, 9); NaN for an object that is no ellipsoid."""
    landmarks: Floats = field(default_factory=lambda: np.zeros((0, 9)))
    """The parameters that were estimated, shape (o, 9): those of the landmark model, or of a
    cuboid or a cylinder its center [m], the logarithms of its half-lengths [log m], and the
    rotation vector of world_from_object [rad]."""
    object_shapes: tuple[Shape, ...] = ()
    """The shape of each mapped object; empty if all are in the landmark model. In `dual_quadrics`
    and `ellipsoids`, an ellipsoid with the same second moments stands for a cuboid or cylinder."""
    shared: Floats = field(default_factory=lambda: np.zeros(0))
    """The numbers that priors of several objects have in common, in the order of the problem:
    by how much the logarithm of a median size differs from `SizePrior.log_mean`, shape (s,)."""
    inliers: Bools = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    """Whether the chi-square of each box is at most `outlier_chi_square`, shape (b,)."""
    dropped: Mapping[int, str] = field(default_factory=dict)
    """Reasons why objects are not in the map, by id."""
    doubtful: Mapping[int, str] = field(default_factory=dict)
    """Reasons why the size or shape of an object in the map is not to be believed, by id."""
    contradicted: Mapping[int, str] = field(default_factory=dict)
    """Mapped objects that their own boxes contradict, with the reason, by id: most of their boxes
    do not fit, or they are where another object is. Their ids are likely wrong."""
    tracks: tuple[Track, ...] = ()
    """What moves, which is not in the map."""

    def __repr__(self) -> str:
        """Show the pose model, and how many poses and objects there are."""
        parts = [self.pose_model.name, counted(len(self.poses), "pose")]
        parts.append(counted(len(self.object_ids), "object"))
        if self.dropped:
            parts.append(f"{len(self.dropped)} dropped")
        if self.contradicted:
            parts.append(f"{len(self.contradicted)} contradicted")
        if self.tracks:
            parts.append(counted(len(self.tracks), "track"))
        return f"Estimate({', '.join(parts)})"

    @property
    def centers(self) -> Floats:
        """Centers of the objects in the world, meters, shape (o, 3): (q4, q7, q9)."""
        return self.dual_quadrics[:, [3, 6, 8]]

    @property
    def shapes(self) -> Floats:
        """Shapes S of the objects, square meters, (o, 3, 3); of any signature."""
        return dual_quadric_shapes(self.dual_quadrics)

    @property
    def semi_axes(self) -> Floats:
        """Semi-axes of the objects, meters, descending, shape (o, 3); NaN for no ellipsoid."""
        return self._axes()[:, :3]

    @property
    def orientations(self) -> Floats:
        """world_from_object of each object, x y z w, shape (o, 4); NaN for no ellipsoid."""
        return self._axes()[:, 3:]

    def _axes(self) -> Floats:
        """Return semi-axes and orientation of each object, shape (o, 7)."""
        rows = np.full((len(self.object_ids), 7), np.nan)
        for row in np.flatnonzero(self.is_ellipsoid):
            rows[row] = np.concatenate(axes_from_ellipsoid(self.ellipsoids[row])[1:])
        return rows

    @property
    def is_body(self) -> Bools:
        """Whether each mapped object is a cuboid or a cylinder, shape (o,)."""
        if not self.object_shapes:
            return np.zeros(len(self.object_ids), dtype=np.bool_)
        return np.array([shape != Shape.ELLIPSOID for shape in self.object_shapes], dtype=np.bool_)

    @property
    def half_lengths(self) -> Floats:
        """Half-lengths [m] of cuboids and cylinders, shape (o, 3); NaN for an ellipsoid.

        The third of a cylinder is along its axis.
        """
        half_lengths = np.full((len(self.object_ids), 3), np.nan)
        if self.object_shapes:
            half_lengths[self.is_body] = np.exp(self.landmarks[self.is_body, 3:6])
        return half_lengths

    @property
    def volumes(self) -> Floats:
        """Volume [m^3] of each object in its own shape, (o,); NaN for no real surface."""
        return self.solids.volumes

    @property
    def solids(self) -> Solids:
        """The surfaces of the objects, to draw, project and compare."""
        turns = self.landmarks[:, 6:9] if self.object_shapes else np.zeros((0, 3))
        return body_solids(
            self.object_shapes, self.ellipsoids, self.centers, self.half_lengths, turns
        )

    def log_semi_axes_variances(self, row: int, covariance: Floats) -> Floats:
        """Return the variances of the logarithms of an object's semi-axes, descending, (3,).

        ``covariance`` (9, 9) is that of its ellipsoid, or of its landmark if it is a cuboid or a
        cylinder.
        """
        if not self.is_body[row]:
            jacobian = log_semi_axes_jacobian(self.ellipsoids[row])
            return np.diagonal(jacobian @ covariance @ jacobian.T)
        # Each semi-axis of the ellipsoid with the same moments is a fixed share of a half-length.
        order = np.argsort(-MOMENTS[self.object_shapes[row]] * self.half_lengths[row])
        return np.diagonal(covariance)[3:6][order]

    @property
    def is_ellipsoid(self) -> Bools:
        """Whether each mapped object is a real ellipsoid, shape (o,)."""
        return np.asarray(np.isfinite(self.ellipsoids).all(axis=1))
