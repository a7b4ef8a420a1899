"""Boxes that may be of one thing, and the problem that they pose."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.association.repeats import find_repeats
from dqslam.association.tracklets import link_tracklets
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.assumptions.traffic import usual_sides
from dqslam.recording import Recording
from dqslam.tracks.body import Views
from dqslam.tracks.fit import covariance, fit_track
from dqslam.tracks.ground import Feet, Ground, feet_of_boxes, feet_of_ellipsoids, find_ground
from dqslam.tracks.motion import ABOVE, HEADING, X, Y, motion_noise
from dqslam.tracks.motion import SIZE as SIZE_OF_STATE
from dqslam.tracks.problem import TrackProblem, Trajectory
from dqslam.tracks.sizes import COMMON_SIGMA, OWN_SIGMA, BodySize, body_size

# Two images tell a speed, but not whether it is one.
FEWEST_IMAGES = 4
# Of a track in more images, that many, evenly spaced, are used: a bound on time and memory.
MOST_IMAGES = 150
# Boxes tell the ground by the heights of their class if they are so near [m].
_NEAR_M = 40.0


@dataclass(frozen=True, eq=False)
class Scene:
    """What tracks are estimated in: cameras that are known, the ground, and what is assumed."""

    recording: Recording
    cameras: Floats
    """world_from_camera of each pose, shape (n, 7)."""
    ground: Ground
    box_noise: BoxNoise
    size_prior: SizePrior | SizePriors | None

    def problem(self, rows: Ints, size: BodySize, class_name: str) -> TrackProblem:
        """Return the problem of some boxes (b,), one an image, in the order of their poses."""
        from scipy.spatial.transform import Rotation

        detections, camera = self.recording.detections, self.recording.camera
        poses, box, turn = (
            detections.pose[rows],
            detections.box[rows],
            self.ground.world_from_ground,
        )
        axes = Rotation.from_quat(self.cameras[poses, 3:]).as_matrix()
        views = Views(camera, turn.T @ axes, self.cameras[poses, :3] @ turn)
        depth = camera.fy * 2.0 * np.exp(size.log_half[2]) / (box[:, 3] - box[:, 1])
        middle = 0.5 * (box[:, 0] + box[:, 2])
        ray = (middle - camera.cx) / camera.fx, (box[:, 3] - camera.cy) / camera.fy
        variance = np.diagonal(self.box_noise.covariance(box, camera), axis1=1, axis2=2)
        return TrackProblem(
            views,
            self.recording.timestamps[poses],
            box,
            variance,
            detections.truncated[rows],
            self.ground.planes(views.rotation, views.position),
            self.ground.sigmas(depth[:, None] * np.column_stack([*ray, np.ones(len(box))])),
            size,
            motion_noise(class_name),
            self.ground.kind == "below the camera",
        )

    def class_name(self, rows: Ints) -> str:
        """Return the class that most of some boxes have."""
        detections = self.recording.detections
        classes, counts = np.unique(detections.class_id[rows], return_counts=True)
        return detections.class_names[int(classes[np.argmax(counts)])]

    def whole_heights(self, rows: Ints) -> int:
        """Return how many of some boxes have an upper and a lower edge that is not cut.

        Where a thing is follows from its height in the image; elsewhere a start may be far off.
        """
        return int(np.sum(~self.recording.detections.truncated[rows][:, [1, 3]].any(axis=1)))

    def size(self, class_name: str) -> BodySize | None:
        """Return the size of a class, where it is known."""
        return body_size(class_name, self.size_prior)


def make_scene(
    recording: Recording,
    poses: Floats,
    ellipsoids: Floats,
    object_rows: Ints,
    box_noise: BoxNoise,
    size_prior: SizePrior | SizePriors | None,
) -> Scene:
    """Return the scene of poses (n, d) and of ellipsoids at rest (o, 9), which show the ground.

    Where too few rest, boxes of classes of known height do. ``object_rows`` (m,) are the ellipsoids
    that boxes show, -1 for none.
    """
    cameras = _core.world_from_camera(recording.odometry.pose_model, recording.camera, poses)
    unknown = find_ground(cameras, NO_FEET)
    up = unknown.world_from_ground[:, 2]
    scene = Scene(recording, cameras, unknown, box_noise, size_prior)
    pose = recording.detections.pose
    shown = [
        np.flatnonzero(object_rows == row)
        for row in np.unique(object_rows[object_rows >= 0]).tolist()
    ]
    feet = [_foot(scene, ellipsoids[object_rows[rows[0]]], rows) for rows in shown]
    counts = [len(rows) for rows in shown]
    found = NO_FEET
    if shown:
        found = Feet(
            np.repeat(np.arange(len(shown)), counts),
            pose[np.concatenate(shown)],
            np.repeat([place for place, _ in feet], counts, axis=0),
            np.repeat([sigma for _, sigma in feet], counts),
        )
    if len(shown) < FEWEST_RESTING:
        found = _feet_of_known_classes(recording, cameras, up, len(shown), found)
    return replace(scene, ground=find_ground(cameras, found))


_NOTHING = np.zeros(0, dtype=np.int64)
NO_FEET = Feet(_NOTHING, _NOTHING, np.zeros((0, 3)), np.zeros(0))
# So many things at rest tell the ground without the help of classes.
FEWEST_RESTING = 5
# The lower end of an ellipsoid is off the foot by about so much [m], ...
SIGMA_OF_END_M = 0.1
# ... and the height of a camera by the height of a class by this share.
SHARE_OF_CLASS = float(np.hypot(COMMON_SIGMA, OWN_SIGMA))
# So many boxes of a thing at rest are enough to tell where it stands, and so many iterations.
_BOXES_OF_FOOT, _ITERATIONS_OF_FOOT = 20, 15


def _foot(scene: Scene, ellipsoid: Floats, rows: Ints) -> tuple[Floats, float]:
    """Return where a thing at rest stands, (3,), and the sigma of its height [m].

    It stands as a cuboid of its class does, or else at the lower end of the ellipsoid. That of an
    ellipsoid that explains the boxes of a car is below the car's.
    """
    from scipy.spatial.transform import Rotation

    turn = scene.ground.world_from_ground
    (lowest,) = feet_of_ellipsoids(ellipsoid[None], turn[:, 2])
    rows = one_an_image(scene.recording, rows)
    size = scene.size(scene.class_name(rows)) if rows.size else None
    if size is None or len(rows) < 2:
        return lowest, SIGMA_OF_END_M
    rows = thinned(rows, most=_BOXES_OF_FOOT)
    problem = scene.problem(rows, size, scene.class_name(rows))
    state = np.zeros((len(rows), SIZE_OF_STATE))
    state[:, X : Y + 1] = lowest @ turn[:, :2]
    state[:, ABOVE] = (lowest @ turn[:, 2] - problem.plane[:, 0]) / problem.above
    orientation = _core.axes_from_ellipsoid(ellipsoid)[2]
    axis = Rotation.from_quat(orientation).as_matrix()[:, 0] @ turn
    state[:, HEADING] = np.arctan2(axis[1], axis[0])
    still = np.zeros(len(rows) - 1, dtype=np.bool_)
    start = Trajectory(state, size.log_half)
    fit = fit_track(problem, start, still, max_iterations=_ITERATIONS_OF_FOOT)
    if fit is None:
        return lowest, SIGMA_OF_END_M
    middle = SIZE_OF_STATE * (len(rows) // 2) + ABOVE
    sigma = problem.above[0] * float(np.sqrt(covariance(fit.equations)[0][middle, middle]))
    return turn @ np.median(problem.feet(fit.trajectory.state), axis=0), sigma


def one_an_image(recording: Recording, rows: Ints) -> Ints:
    """Return the surest of some boxes (b,) in each image, in order of the poses."""
    detections = recording.detections
    rows = rows[np.lexsort((-detections.score[rows], detections.pose[rows]))]
    return rows[np.diff(detections.pose[rows], prepend=-1) > 0]


def _feet_of_known_classes(
    recording: Recording, cameras: Floats, up: Floats, known: int, feet: Feet
) -> Feet:
    """Add where things of known height stand by their boxes to the feet of ``known`` things.

    Each box is a thing by itself. ``up`` is a unit vector in the world, (3,).
    """
    detections = recording.detections
    sides = {number: usual_sides(name) for number, name in detections.class_names.items()}
    heights = np.array(
        [np.nan if (own := sides[one]) is None else own[2] for one in detections.class_id.tolist()]
    )
    usable = np.isfinite(heights) & ~detections.truncated[:, [1, 3]].any(axis=1)
    images = detections.pose[usable]
    seen_from = cameras[detections.pose]
    place = feet_of_boxes(recording.camera, seen_from, detections.box, usable, heights)
    run = place - cameras[images, :3]
    near = np.linalg.norm(run, axis=1) < _NEAR_M
    drop = np.abs(run[near] @ up)
    return Feet(
        np.append(feet.thing, known + np.arange(near.sum())),
        np.append(feet.image, images[near]),
        np.concatenate([feet.place, place[near]]),
        np.append(feet.sigma, SHARE_OF_CLASS * drop),
    )


def group_boxes(recording: Recording, free: Bools, *, final: bool) -> list[Ints]:
    """Return the rows of the free boxes (m,) of each thing, one an image, in order of time.

    Things are those of the tracker's ids if these are ``final``, else tracklets in the image.
    """
    rows = np.flatnonzero(free)
    if not rows.size:
        return []
    boxes = recording.detections.select(rows)
    number = boxes.object_id
    if not final:
        surer = find_repeats(boxes)
        rows = rows[surer == np.arange(len(rows))]
        boxes = recording.detections.select(rows)
        tracker_ids = boxes.object_id
        number = link_tracklets(replace(recording, detections=boxes), tracker_ids=tracker_ids)
    things = [rows[number == one] for one in np.unique(number).tolist()]
    return [one_an_image(recording, thing) for thing in things]


def thinned(rows: Ints, *, most: int = MOST_IMAGES) -> Ints:
    """Return at most so many of some rows (n,), evenly spaced."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).round().astype(np.int64)]
