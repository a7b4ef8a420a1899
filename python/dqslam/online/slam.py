"""A session: steps in, an estimate at any time out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam import _core
from dqslam._checks import Floats, Ints, as_covariances
from dqslam.estimate import Estimate
from dqslam.online.identify import Identifier
from dqslam.online.objects import Objects, Registry
from dqslam.online.polish import Polished, polish_session, start_polish
from dqslam.online.relocalise import Relocation, relocalise
from dqslam.online.step import (
    Motion,
    StepBoxes,
    StepError,
    StepPositions,
    check_boxes,
)
from dqslam.problem import BoxNoise
from dqslam.recording import as_poses, pose_size, tangent_size
from dqslam.size_prior import SizePrior, SizePriors

Int32s = NDArray[np.int32]

_NO_ROWS = np.zeros(0, dtype=np.int32)
_NO_FLOATS = np.zeros(0)
_NO_POSITIONS = (_NO_ROWS, np.zeros((0, 3)), np.zeros((0, 9)))


class OnlineSlam:
    """Object SLAM step by step.

    Each ``add`` does bounded work and leaves an estimate that can be used: ``pose``,
    ``trajectory``, ``objects``. Objects have a size prior from their first box, so no state is ever
    indeterminate.

    Parameters
    ----------
    camera
        Of undistorted boxes, and where it is on the robot.
    options
        Of the solver: its loss is that of ``polish``, and any but ``NONE`` makes the steps robust.
    online
        Of the steps: how many poses are minimised, and when.
    pose_model
        SE2 or SE3.
    first_pose, first_covariance
        world_from_robot of the first step, the origin by default, and its covariance (k, k), by
        default none: it is exact.
    box_noise, size_prior, scene_priors
        What is assumed, as ``build_graph`` has it.
    """

    def __init__(
        self,
        camera: _core.Camera,
        options: _core.SolveOptions | None = None,
        *,
        online: _core.OnlineOptions | None = None,
        pose_model: _core.PoseModel = _core.PoseModel.SE2,
        first_pose: ArrayLike | None = None,
        first_covariance: ArrayLike | None = None,
        box_noise: BoxNoise | None = None,
        size_prior: SizePrior | SizePriors | None = None,
        scene_priors: _core.ScenePriors | None = None,
    ) -> None:
        """Begin a session without a step."""
        self.camera = camera
        self.pose_model = pose_model
        self.solve_options = _core.SolveOptions() if options is None else options
        if self.solve_options.landmark_model != _core.LandmarkModel.ELLIPSOID:
            raise ValueError("online: only the ellipsoid model has a prior on size")
        online = _core.OnlineOptions() if online is None else online
        if self.solve_options.loss != _core.Loss.NONE and online.loss_scale == 0.0:
            online = _with_loss(online, self.solve_options.loss_scale)
        scene = _core.ScenePriors() if scene_priors is None else scene_priors
        self._session = _core.Session(pose_model, camera, scene, online)
        self._registry = Registry(size_prior)
        self._box_noise = BoxNoise() if box_noise is None else box_noise
        self._timestamps: list[float] = []
        origin = np.zeros(pose_size(pose_model))
        if pose_model == _core.PoseModel.SE3:
            origin[-1] = 1.0
        given = origin if first_pose is None else first_pose
        self._first_pose = as_poses("first_pose", np.atleast_2d(given), pose_model)[0]
        self._first_covariance = np.zeros((0, 0))
        if first_covariance is not None:
            k = tangent_size(pose_model)
            covariance = np.asarray(first_covariance, dtype=np.float64)[None]
            self._first_covariance = as_covariances("first_covariance", covariance, 1, k)[0]
        self.shown: Ints = np.zeros(0, dtype=np.int64)
        """Object that each box of the last step was given, -1 for one that waits; shape (b,)."""
        self._pending: Future[Polished] | None = None
        self._map_rows = 0
        self._map_covariance: dict[int, Floats] = {}
        self._identifier = Identifier(camera, pose_model)

    # ------------------------------------------------------------------------------ steps

    def add(
        self,
        odometry: Motion | None,
        boxes: StepBoxes | None = None,
        *,
        timestamp: float | None = None,
        positions: StepPositions | None = None,
    ) -> _core.StepReport:
        """Add a step and bring the estimate up to date.

        Parameters
        ----------
        odometry
            None for the first step only.
        boxes
            None or empty for a step that saw nothing. Boxes of object -1 are given to the object
            that they clearly show, or to a new one once a few of them follow each other.
        timestamp
            Seconds, after that of the step before; by default one second later.

        Raises
        ------
        StepError
            For a time that does not increase, a step without odometry, numbers that are not finite
            and boxes that are none. Nothing has changed then.
        """
        self._take_polished()
        count = len(self._timestamps)
        try:
            tracks = None
            time = self._time(timestamp)
            checked = check_boxes(boxes)
            relative, covariance = self._motion(odometry)
            shown = checked.object_id
            if checked.ids and min(checked.ids) < 0:
                shown, tracks = self._identifier.identify(
                    self._session,
                    self._registry,
                    checked,
                    relative,
                    covariance,
                    self._box_noise,
                )
                checked = checked.select(shown)
            rows, new = self._registry.rows(checked.ids, checked.class_name)
            report = self._session.add(
                relative,
                covariance,
                np.array(rows, dtype=np.int32),
                checked.box,
                self._box_noise_rows(checked.box),
                checked.truncated,
                *self._position_rows(positions),
                np.array([prior.log_mean for _, prior in new]) if new else _NO_FLOATS,
                np.array([prior.log_sigma for _, prior in new]) if new else _NO_FLOATS,
            )
        except (ValueError, TypeError) as error:
            raise StepError(f"step {count}: {error}") from None
        if tracks is not None:
            self._identifier.tracks = tracks
        self.shown = shown
        self._registry.register(new)
        for row, name in zip(rows, checked.class_name, strict=True):
            self._registry.votes[row][name] += 1
        self._timestamps.append(time)
        return report

    def _time(self, timestamp: float | None) -> float:
        last = self._timestamps[-1] if self._timestamps else None
        if timestamp is None:
            return 0.0 if last is None else last + 1.0
        time = float(timestamp)
        if not math.isfinite(time):
            raise ValueError(f"timestamp {time} is not finite")
        if last is not None and time <= last:
            word = "repeats the last one" if time == last else f"is before the last, {last!r}"
            raise ValueError(f"timestamp {time!r} {word}")
        return time

    def _motion(self, odometry: Motion | None) -> tuple[Floats, Floats]:
        if not self._timestamps:
            if odometry is not None:
                raise ValueError("the first step has no odometry: it is where the path begins")
            return self._first_pose, self._first_covariance
        if odometry is None:
            raise ValueError(
                "no odometry leads here; across a gap, give a guess and a covariance as wide"
            )
        return (
            np.asarray(odometry.relative, dtype=np.float64),
            np.asarray(odometry.covariance, dtype=np.float64),
        )

    def _box_noise_rows(self, box: Floats) -> Floats:
        """Return the covariances of boxes (b, 4), shape (b, 16)."""
        rows = np.zeros((len(box), 16))
        if len(box):
            if self._box_noise.relative:
                side = np.tile(box[:, 2:] - box[:, :2], 2)
                rows[:, ::5] = self._box_noise.pixels**2 + (self._box_noise.relative * side) ** 2
            else:
                rows[:, ::5] = self._box_noise.pixels**2
        return rows

    def _position_rows(self, positions: StepPositions | None) -> tuple[Int32s, Floats, Floats]:
        if positions is None:
            return _NO_POSITIONS
        ids = np.asarray(positions.object_id).tolist()
        unknown = [number for number in ids if number not in self._registry]
        if unknown:
            raise ValueError(f"positions: no box has shown object {unknown[0]} yet")
        rows = np.array([self._registry.row_of(number) for number in ids], dtype=np.int32)
        covariance = np.asarray(positions.covariance, dtype=np.float64).reshape(len(ids), 9)
        return rows, np.asarray(positions.object_in_robot, dtype=np.float64), covariance

    # ------------------------------------------------------------------------------ estimate

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._timestamps)

    @property
    def pose(self) -> Floats:
        """world_from_robot now, shape (d,); the first pose before any step."""
        if not self._timestamps:
            return np.asarray(self._first_pose)
        return np.asarray(self._session.pose_at(len(self._timestamps) - 1))

    @property
    def trajectory(self) -> Floats:
        """world_from_robot of every step, shape (n, d)."""
        return self._session.poses

    @property
    def timestamps(self) -> Floats:
        """Seconds, shape (n,)."""
        return np.array(self._timestamps)

    @property
    def count(self) -> int:
        """How many objects there are."""
        return int(self._session.num_objects)

    @property
    def objects(self) -> Objects:
        """The objects as they stand."""
        return Objects(
            ids=np.array(self._registry.ids, dtype=np.int64),
            class_names=self._registry.class_names(),
            ellipsoids=self._session.ellipsoids,
            observations=self._session.observations.astype(np.int64),
        )

    def estimate(self) -> Estimate:
        """Return all of it as ``solve`` does, objects by ascending ids."""
        objects = self.objects
        order = np.argsort(objects.ids, kind="stable")
        ellipsoids = objects.ellipsoids[order]
        graph, _ = self._session.to_graph()
        return Estimate(
            pose_model=self.pose_model,
            camera=self.camera,
            timestamps=self.timestamps,
            poses=self.trajectory,
            initial_poses=graph.initial_poses,
            object_ids=objects.ids[order],
            class_names=tuple(objects.class_names[row] for row in order),
            observations=objects.observations[order],
            dual_quadrics=np.array(
                [_core.dual_quadric_from_ellipsoid(one) for one in ellipsoids]
            ).reshape(-1, 9),
            ellipsoids=ellipsoids,
        )

    # ------------------------------------------------------------------------------ polish

    def polish(self, *, background: bool = False) -> Future[Polished]:
        """Minimise all that has arrived, as ``solve`` does, from where the session stands.

        In the background, the result is merged at the first ``add`` after it is done: what arrived
        meanwhile moves along rigidly. ``result()`` of what is returned waits for it. Without steps
        or boxes there is nothing to do.
        """
        self._take_polished(wait=True)
        work = polish_session(self._session, self.solve_options, keeps_map=self._map_rows > 0)
        started = self._pending = start_polish(work, background=background)
        self._take_polished(wait=not background)
        return started

    def _take_polished(self, *, wait: bool = False) -> None:
        """Merge what a polish has found, if it is done."""
        pending = self._pending
        if pending is None or not (wait or pending.done()):
            return
        self._pending = None
        found = pending.result()
        if len(found.poses):
            ellipsoids = self._session.ellipsoids[: found.objects]
            ellipsoids[found.rows] = found.ellipsoids
            self._session.merge(found.poses, ellipsoids)

    # ------------------------------------------------------------------------------ maps

    def relocalise(self, boxes: StepBoxes) -> Relocation:
        """Find the pose from which boxes of known objects, or classes, were seen.

        Raises
        ------
        ValueError
            With too few boxes of the map, when no pose explains them, or when two do.
        """
        checked = check_boxes(boxes)
        return relocalise(
            self.camera,
            self.pose_model,
            self.objects,
            self._covariances(),
            checked,
            self._box_noise_rows(checked.box),
        )

    def _covariances(self) -> Mapping[int, Floats]:
        """Return the covariance (9, 9) of each row of the map that has one."""
        from dqslam.online.maps import object_covariances

        return self._map_covariance | object_covariances(
            self._session, self.solve_options, skip=set(self._map_covariance)
        )

    def save(self, directory: str | Path) -> None:
        """Write the estimate and its covariances, as ``save_estimate`` does."""
        from dqslam.online.maps import save_session

        save_session(self, self._session, self._registry.ids, self._covariances(), directory)

    @classmethod
    def load(
        cls,
        directory: str | Path,
        options: _core.SolveOptions | None = None,
        *,
        pose_model: _core.PoseModel = _core.PoseModel.SE2,
        robot_from_camera: ArrayLike | None = None,
        first_pose: ArrayLike | None = None,
        first_covariance: ArrayLike | None = None,
        first_boxes: StepBoxes | None = None,
        box_noise: BoxNoise | None = None,
        online: _core.OnlineOptions | None = None,
        size_prior: SizePrior | SizePriors | None = None,
        scene_priors: _core.ScenePriors | None = None,
    ) -> OnlineSlam:
        """Continue a map that was saved: its objects, with their covariances, are what is known.

        Where the session begins is found from ``first_boxes``, or given; ``first_boxes`` are then
        the first step. ``robot_from_camera`` is the mount, which no result has.

        Raises
        ------
        FileError
            For results that are missing or wrong.
        ValueError
            When the boxes do not tell the pose.
        """
        from dqslam.online.maps import load_map, with_mount

        known = load_map(directory)
        camera = with_mount(known.camera, robot_from_camera)
        if first_boxes is not None and first_pose is None:
            probe = cls(camera, pose_model=pose_model, box_noise=box_noise, size_prior=size_prior)
            probe._add_map(known)
            found = probe.relocalise(first_boxes)
            first_pose, first_covariance = found.pose, found.covariance
            first_boxes = found.with_ids(first_boxes)
        slam = cls(
            camera,
            options,
            online=online,
            pose_model=pose_model,
            first_pose=first_pose,
            first_covariance=first_covariance,
            box_noise=box_noise,
            size_prior=size_prior,
            scene_priors=scene_priors,
        )
        slam._add_map(known)
        if first_boxes is not None:
            slam.add(None, first_boxes)
        return slam

    def _add_map(self, known: object) -> None:
        from dqslam.online.maps import KnownMap

        assert isinstance(known, KnownMap)
        for number, name, ellipsoid, covariance in known.rows():
            prior = self._registry.prior_of(name)
            self._session.add_map_object(ellipsoid, covariance, prior.log_mean, prior.log_sigma)
            self._registry.register([(number, prior)])
            self._registry.votes[-1][name] += 1
            self._map_covariance[len(self._registry.ids) - 1] = covariance
        self._map_rows = len(self._registry.ids)


def _with_loss(online: _core.OnlineOptions, loss_scale: float) -> _core.OnlineOptions:
    """Return the same options with a loss on boxes."""
    names = [name for name in dir(online) if not name.startswith("_")]
    return _core.OnlineOptions(
        **{name: getattr(online, name) for name in names} | {"loss_scale": loss_scale}
    )
