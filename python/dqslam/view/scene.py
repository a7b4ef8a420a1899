"""The scene that viewers show, as plain data. Viewers compute nothing themselves.

The world is that of the estimate, in meters, and the truth is moved into it. Poses are
world_from_camera, [tx ty tz qx qy qz qw]. Boxes are [u_min, v_min, u_max, v_max] in undistorted
pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._colors import TRUTH, class_colors, moving_colors, object_colors
from dqslam.evaluation import common_poses, evaluate_results, fit_boxes
from dqslam.io import BoxTable, MapObjects, Results, Trajectory, TrueObjects
from dqslam.metrics import Align, Alignment, up_direction
from dqslam.solids import Solids
from dqslam.view.body import Body, body_of
from dqslam.view.numbers import Numbers, object_numbers, overview, true_object_numbers
from dqslam.view.surface_mesh import SurfaceMesh
from dqslam.view.tracks import SceneTrack, scene_tracks

# The true path has a gap if its poses are further apart than this multiple of the usual distance.
GAP = 5.0
# Number of standard deviations of the ellipsoids of uncertainty.
SIGMAS = 3.0
CAMERAS = 60
# Added variance, m^2, so that no axis of an ellipsoid is zero.
_NOTHING = 1e-18


@dataclass(frozen=True, eq=False)
class Spread:
    """The ellipsoid of uncertainty of a position, at ``SIGMAS`` standard deviations."""

    center: Floats
    """Meters, shape (3,)."""
    semi_axes: Floats
    """Meters, shape (3,)."""
    orientation_xyzw: Floats
    """world_from_ellipsoid, shape (4,)."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One object of the map or of the truth."""

    id: int
    """Id of the object, -1 for a true object without one."""
    class_name: str
    color: str
    """``#rrggbb``, by class, or by object if there is only one class."""
    center: Floats
    """Meters, shape (3,)."""
    semi_axes: Floats | None
    """Of the ellipsoid, meters, shape (3,); None if it is none or its size is unknown."""
    orientation_xyzw: Floats | None
    """world_from_object, shape (4,); None if ``semi_axes`` is None."""
    center_covariance: Floats | None
    """Square meters, shape (3, 3); None if unknown."""
    numbers: Numbers
    """Its properties as text."""
    body: Body | None = None
    """What it is if it is a cuboid or a cylinder, for which the ellipsoid only stands."""
    surface: SurfaceMesh | None = None
    """Its surface from depth images, in its own frame; None without one."""
    chi_square: float | None = None
    """Median chi-square of its boxes that no border cuts, 3.36 is usual; None without any."""

    @property
    def ellipsoid(self) -> Floats | None:
        """Center and log-Cholesky shape, shape (9,); None if it is no ellipsoid."""
        if self.semi_axes is None or self.orientation_xyzw is None:
            return None
        return _core.ellipsoid_from_axes(self.center, self.semi_axes, self.orientation_xyzw)

    @property
    def spread(self) -> Spread | None:
        """The uncertainty of the center; None if unknown."""
        if self.center_covariance is None:
            return None
        return spread_of(self.center, self.center_covariance)


@dataclass(frozen=True, eq=False)
class SceneBoxes:
    """All boxes, in the order of their poses."""

    pose: Ints
    """Row of the pose from which it was observed, shape (m,)."""
    box: Floats
    """Shape (m, 4)."""
    object: Ints
    """Row of the mapped object that it was assigned to, -1 for none; shape (m,)."""
    class_name: tuple[str, ...]
    """One per box."""
    state: tuple[str, ...]
    """``fits``, ``misfit`` (an outlier), ``held out`` or ``left out`` (of no mapped object)."""

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.pose)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a viewer shows."""

    title: str
    up: Floats
    """Upward unit vector in the world, shape (3,)."""
    camera: _core.Camera
    timestamps: Floats
    """Seconds, shape (n,)."""
    estimate: Floats
    """Shape (n, 7)."""
    odometry: Floats
    """Shape (n, 7)."""
    cameras: Ints
    """Rows of the poses whose cameras are drawn, at most ``CAMERAS``."""
    pose_spreads: tuple[Spread, ...]
    """Uncertainties of positions, of at most ``CAMERAS`` poses for which they are known."""
    truth: tuple[Floats, ...]
    """True poses, split at gaps into parts of shape (t, 7)."""
    objects: tuple[SceneObject, ...]
    true_objects: tuple[SceneObject, ...]
    solids: Solids
    """The surfaces of the mapped objects."""
    boxes: SceneBoxes
    overview: Numbers
    """The properties of the estimate as text."""
    tracks: tuple[SceneTrack, ...] = ()
    """What moves."""


def rgb(color: str) -> tuple[int, int, int]:
    """Return red, green and blue of ``#rrggbb``, each 0 to 255."""
    red, green, blue = bytes.fromhex(color[1:])
    return red, green, blue


def spread_of(center: Floats, covariance: Floats) -> Spread:
    """Return the spread of a position (3,) [m] with a covariance (3, 3) [m^2]."""
    from scipy.spatial.transform import Rotation

    squares, axes = np.linalg.eigh(covariance)
    axes[:, 0] *= np.linalg.det(axes)  # makes it a rotation, not a reflection
    semi_axes = SIGMAS * np.sqrt(squares.clip(min=_NOTHING))
    return Spread(center, semi_axes, Rotation.from_matrix(axes).as_quat())


def build_scene(
    results: Results,
    *,
    groundtruth: Trajectory | None = None,
    objects: TrueObjects | None = None,
    align: Align = "se3",
) -> Scene:
    """Return the scene of an estimate.

    Parameters
    ----------
    groundtruth, objects
        The true trajectory and objects, in any world; ``evaluate_results`` aligns them.
    align
        The kind of motion between both worlds, see ``metrics.align_positions``.

    Raises
    ------
    ValueError
        If there are true objects without a true trajectory, or a true trajectory whose times
        match no pose.
    """
    if objects is not None and groundtruth is None:
        raise ValueError(f"{objects.path}: true objects need a true trajectory for the alignment")
    evaluation: dict[str, Any] = {}
    truth: tuple[Floats, ...] = ()
    true_objects: tuple[SceneObject, ...] = ()
    true_names = () if objects is None else objects.class_name or ()
    moving = [one.class_name for one in results.tracks]
    colors = class_colors(results.objects.class_names, true_names, moving)
    if groundtruth is not None:
        evaluation = evaluate_results(results, groundtruth, align=align, objects=objects)
        estimated_from_true = _inverse(evaluation["true_from_estimated"])
        rows, true_rows = common_poses(results.timestamps, groundtruth)
        poses = estimated_from_true.apply_poses(groundtruth.world_from_camera[true_rows])
        truth = tuple(np.split(poses, _gaps(rows)))
        if objects is not None:
            true_objects = _true_objects(objects, estimated_from_true, colors)
    return Scene(
        title="/".join(results.directory.resolve().parts[-2:]),
        up=up_direction(results.poses),
        camera=results.camera,
        timestamps=results.timestamps,
        estimate=results.poses,
        odometry=results.initial_poses,
        cameras=_some(np.arange(len(results.timestamps))),
        pose_spreads=_pose_spreads(results),
        truth=truth,
        objects=_mapped_objects(results, evaluation, colors),
        true_objects=true_objects,
        solids=results.objects.solids,
        boxes=_boxes(results.boxes, results.objects),
        overview=overview(results, evaluation),
        tracks=scene_tracks(
            results.tracks, moving_colors(results.objects.class_names, moving, colors)
        ),
    )


def _some(rows: Ints) -> Ints:
    """Return at most ``CAMERAS`` of some rows, evenly spread."""
    return rows[:: max(1, -(-len(rows) // CAMERAS))]


def _pose_spreads(results: Results) -> tuple[Spread, ...]:
    from scipy.spatial.transform import Rotation

    # In the frame of the camera. The first pose is exact and has no ellipsoid.
    covariance = results.covariances[:, :3, :3]
    known = np.isfinite(covariance).all(axis=(1, 2)) & (covariance != 0.0).any(axis=(1, 2))
    spreads = []
    for row in _some(np.flatnonzero(known)):
        turn = Rotation.from_quat(results.poses[row, 3:]).as_matrix()
        in_world = turn @ covariance[row] @ turn.T
        spreads.append(spread_of(results.poses[row, :3], in_world))
    return tuple(spreads)


def _gaps(rows: Ints) -> Ints:
    """Return the indices into rows (t,), ascending, at which a new part begins after a gap."""
    steps = np.diff(rows)
    return np.asarray(np.flatnonzero(steps > GAP * np.median(steps)) + 1)


def _inverse(true_from_estimated: Mapping[str, Any]) -> Alignment:
    from scipy.spatial.transform import Rotation

    scale = true_from_estimated["scale"]
    rotation = Rotation.from_quat(true_from_estimated["rotation_xyzw"]).as_matrix().T
    return Alignment(rotation, -rotation @ true_from_estimated["translation"] / scale, 1.0 / scale)


def _mapped_objects(
    results: Results, evaluation: Mapping[str, Any], colors: dict[str, str]
) -> tuple[SceneObject, ...]:
    mapped = results.objects
    numbers = object_numbers(results, evaluation)
    chi_squares = _chi_squares(results)
    of_object = object_colors(mapped.class_names, colors)
    solids = mapped.solids
    return tuple(
        SceneObject(
            id=int(mapped.object_ids[row]),
            class_name=mapped.class_names[row],
            color=of_object[row],
            center=mapped.centers[row],
            semi_axes=_known(mapped.semi_axes[row]),
            orientation_xyzw=_known(mapped.orientations[row]),
            center_covariance=_known(mapped.center_covariances[row]),
            numbers=numbers[row],
            body=body_of(solids, row),
            chi_square=chi_squares[row],
        )
        for row in range(len(mapped))
    )


def _chi_squares(results: Results) -> list[float | None]:
    """Return the median chi-square of the boxes of each object that were used."""
    medians: list[float | None] = [None] * len(results.objects)
    if results.boxes is None:
        return medians
    fits = fit_boxes(results)
    counts = np.isfinite(fits.chi2) & ~results.boxes.held_out
    for row in np.unique(fits.object_row[counts]).tolist():
        if row >= 0:
            medians[row] = float(np.median(fits.chi2[counts & (fits.object_row == row)]))
    return medians


def _true_objects(
    true: TrueObjects, estimated_from_true: Alignment, colors: Mapping[str, str]
) -> tuple[SceneObject, ...]:
    from scipy.spatial.transform import Rotation

    centers = estimated_from_true.apply(true.center)
    semi_axes = orientations = None
    if true.size is not None and true.rotation is not None:
        semi_axes = 0.5 * estimated_from_true.scale * true.size
        rotations = estimated_from_true.rotation @ true.rotation
        orientations = Rotation.from_matrix(rotations).as_quat()
    shown = []
    for row in range(len(true)):
        name = "" if true.class_name is None else true.class_name[row]
        shown.append(
            SceneObject(
                id=-1 if true.id is None else int(true.id[row]),
                class_name=name,
                color=colors.get(name, TRUTH),
                center=centers[row],
                semi_axes=None if semi_axes is None else semi_axes[row],
                orientation_xyzw=None if orientations is None else orientations[row],
                center_covariance=None,
                numbers=true_object_numbers(true, row),
            )
        )
    return tuple(shown)


def _known(values: Floats) -> Floats | None:
    return values if np.isfinite(values).all() else None


def _boxes(boxes: BoxTable | None, mapped: MapObjects) -> SceneBoxes:
    if boxes is None:
        none = np.zeros(0, dtype=np.int64)
        return SceneBoxes(none, np.zeros((0, 4)), none, (), ())
    row_of = {int(number): row for row, number in enumerate(mapped.object_ids)}
    order = np.argsort(boxes.pose, kind="stable")
    mapped_row = np.array([row_of.get(int(boxes.object_id[row]), -1) for row in order], dtype=int)
    states = []
    for row, known in zip(order, mapped_row >= 0, strict=True):
        if not known:
            states.append("left out")
        elif boxes.held_out[row]:
            states.append("held out")
        else:
            states.append("fits" if boxes.inlier[row] else "misfit")
    return SceneBoxes(
        pose=boxes.pose[order],
        box=boxes.box[order],
        object=mapped_row,
        class_name=tuple(boxes.class_name[row] for row in order),
        state=tuple(states),
    )
