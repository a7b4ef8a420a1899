"""The tracks of all things that no place at rest explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.recording import Recording
from dqslam.track import Track
from dqslam.tracks.candidates import FEWEST_IMAGES, Scene, group_boxes, make_scene, thinned
from dqslam.tracks.fit import TrackFit, covariance, fit_track
from dqslam.tracks.ground import Ground
from dqslam.tracks.join import join_tracklets
from dqslam.tracks.judge import Judgment, judge
from dqslam.tracks.mixture import mixed
from dqslam.tracks.motion import ABOVE, HEADING, SIZE, SPEED, TURN, X, Y
from dqslam.tracks.problem import TrackProblem, Trajectory
from dqslam.tracks.reckoned import PathCovariance
from dqslam.tracks.switches import Explanation


@dataclass(frozen=True, eq=False)
class Tracked:
    """What boxes that the map does not explain show."""

    tracks: tuple[Track, ...]
    resting: tuple[Ints, ...]
    """Rows of the boxes of things that rest, though the map has them not."""
    unknown: tuple[tuple[Ints, str], ...]
    """Rows of the boxes of things of which nothing can be said, and why."""
    ground: Ground
    track_of_box: Ints
    """Id of the track of each box, -1 for none, shape (m,)."""


def estimate_tracks(
    recording: Recording,
    poses: Floats,
    ellipsoids: Floats,
    object_rows: Ints,
    *,
    final: bool,
    box_noise: BoxNoise,
    size_prior: SizePrior | SizePriors | None = None,
    path_covariance: PathCovariance = lambda images: None,
) -> Tracked:
    """Estimate the tracks of what moves.

    The path is that of the estimate, and what is unknown of it is added to first order: what moves
    as it likes tells a path next to nothing.

    Parameters
    ----------
    recording
        Its object ids are those of a tracker, -1 where there are none.
    poses, ellipsoids
        Of the estimate, shape (n, d), and its objects at rest, shape (o, 9).
    object_rows
        Row of the ellipsoid that each box shows, shape (m,); -1 for those that may show what moves.
    final
        Whether the tracker's ids are final: then each of them is a thing by itself, and else
        tracklets of one thing are joined where its motion predicts it.
    size_prior
        Sizes that were told by class; those of traffic are known.
    """
    scene = make_scene(recording, poses, ellipsoids, object_rows, box_noise, size_prior)
    moving: list[tuple[Ints, Judgment]] = []
    still: list[Ints] = []
    unknown: list[tuple[Ints, str]] = []
    track_of_box = np.full(len(recording.detections), -1)
    groups = group_boxes(recording, object_rows < 0, final=final)
    groups.sort(key=lambda group: int(recording.detections.pose[group[0]]))
    for rows in groups if final else join_tracklets(scene, groups):
        judged = _judge(scene, rows, path_covariance)
        if isinstance(judged, str):
            unknown.append((rows, judged))
        elif judged.is_mover:
            track_of_box[rows] = len(moving)
            moving.append((thinned(rows), judged))
        elif judged.behavior == "rests":
            still.append(rows)
        else:
            unknown.append((rows, "whether it moves or rests is open"))
    grounds = _grounds_of_movers(scene, moving)
    tracks = tuple(
        _track(replace(scene, ground=ground), rows, judged, number, path_covariance)
        for number, ((rows, judged), ground) in enumerate(zip(moving, grounds[:-1], strict=True))
    )
    return Tracked(tracks, tuple(still), tuple(unknown), grounds[-1], track_of_box)


def _judge(scene: Scene, rows: Ints, path_covariance: PathCovariance) -> Judgment | str:
    """Judge what some boxes (b,) show; or say why that cannot be done."""
    if len(rows) < FEWEST_IMAGES:
        return f"seen in {len(rows)} images, {FEWEST_IMAGES} are needed"
    whole = scene.whole_heights(rows)
    if whole < FEWEST_IMAGES:
        return f"its whole height is seen in {whole} images, {FEWEST_IMAGES} are needed"
    class_name = scene.class_name(rows)
    size = scene.size(class_name)
    if size is None:
        return f"nothing tells how large a {class_name} is, hence nothing how far away it is"
    rows = thinned(rows)
    path = path_covariance(scene.recording.detections.pose[rows])
    judged = judge(scene.problem(rows, size, class_name), path)
    return "no motion explains its boxes" if judged is None else judged


def _grounds_of_movers(scene: Scene, moving: list[tuple[Ints, Judgment]]) -> list[Ground]:
    """Return the ground of each thing that moves, as the others correct it, and that by all.

    Where each stands without the ground follows from its size. All of them together know the ground
    under them better than things at rest beside it. What a thing says itself is in its boxes.
    """
    if scene.ground.kind == "unknown" or not moving:
        return [scene.ground] * (len(moving) + 1)
    loose = replace(scene, ground=scene.ground.of_unknown_height())
    stands = np.zeros((len(moving), 3))
    for number, (rows, judged) in enumerate(moving):
        problem, (fit,) = _refit(loose, rows, judged, judged.explanations[:1])
        state, views = fit.trajectory.state, problem.views
        distance = np.linalg.norm(state[:, X : Y + 1] - views.position[:, :2], axis=1)
        row = int(np.argmin(distance))
        place = SIZE * row + ABOVE
        sigma = problem.above[row]
        variance = sigma**2 * covariance(fit.equations)[0][place, place]
        stands[number] = sigma * state[row, ABOVE], variance, distance[row]
    others = [np.delete(stands, number, axis=0) for number in range(len(moving))]
    return [scene.ground.corrected(*some.T) for some in (*others, stands)]


def _refit(
    scene: Scene, rows: Ints, judged: Judgment, ways: Sequence[Explanation]
) -> tuple[TrackProblem, list[TrackFit]]:
    """Return the problem of some boxes (n,) in a scene that is a little different, and fits of it.

    Where no step leads on, an estimate stays where it is.
    """
    class_name = scene.class_name(rows)
    size = scene.size(class_name)
    assert size is not None  # what has none was not judged
    problem = scene.problem(rows, size, class_name)
    fits = []
    for way in ways:
        start = _in_sigmas_of(problem, judged.above, way.fit.trajectory)
        fit = fit_track(problem, start, way.moves)
        fits.append(way.fit if fit is None else fit)
    return problem, fits


def _in_sigmas_of(problem: TrackProblem, above: Floats, at: Trajectory) -> Trajectory:
    """Return an estimate with heights in the sigmas of another problem."""
    state = at.state.copy()
    state[:, ABOVE] *= above / problem.above
    return Trajectory(state, at.log_half)


def _track(
    scene: Scene, rows: Ints, judged: Judgment, track_id: int, path_covariance: PathCovariance
) -> Track:
    """Return the track of some boxes (n,) in the world, with its uncertainty."""
    from scipy.spatial.transform import Rotation

    count = len(rows)
    problem, fits = _refit(scene, rows, judged, judged.explanations)
    poses, ground = scene.recording.detections.pose[rows], scene.ground
    ways = list(zip(fits, judged.explanations, judged.weights.tolist(), strict=True))
    moments = mixed(problem, ways, path_covariance(poses))
    state, blocks, log_half = moments.state, moments.covariance, moments.log_half
    half = np.exp(log_half)
    center = problem.feet(state) + [0.0, 0.0, half[2]]
    # The center by x, y and height of the foot, and by the logarithm of half the height.
    jacobian = np.zeros((count, 3, SIZE + 3))
    jacobian[:, range(3), range(3)] = 1.0
    jacobian[:, 2, :2], jacobian[:, 2, ABOVE] = problem.plane[:, 1:], problem.above
    jacobian[:, 2, SIZE + 2] = half[2]
    turn = ground.world_from_ground
    of_center = turn @ jacobian @ blocks @ jacobian.transpose(0, 2, 1) @ turn.T
    sigma = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
    upright = Rotation.from_euler("z", state[:, HEADING, None])
    return Track(
        track_id,
        scene.class_name(rows),
        judged.behavior,
        1.0 - judged.probability["rests"],
        poses,
        center @ turn.T,
        (Rotation.from_matrix(turn) * upright).as_quat(),
        np.arctan2(np.sin(state[:, HEADING]), np.cos(state[:, HEADING])),
        state[:, SPEED],
        state[:, TURN],
        moments.moving > 0.5,
        2.0 * half,
        of_center,
        sigma[:, HEADING],
        sigma[:, SPEED],
        sigma[:, TURN],
        sigma[0, SIZE:],
    )
