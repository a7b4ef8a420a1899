"""A session: steps in, an estimate at any time out."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, Ints, require
from dqslam._repr import counted
from dqslam.association import FINAL, UNSURE
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.online.identify import Identifier, NewBoxes
from dqslam.online.inputs import PathBegin, box_noise_rows, motion_arrays, next_time, position_rows
from dqslam.online.keyframes import Journal
from dqslam.online.local_map import Assumptions
from dqslam.online.objects import Objects, Registry
from dqslam.online.polish import Polish, Polished, Polisher, Smoothing, Solve
from dqslam.online.relocalize import Relocation, relocalize
from dqslam.online.step import (
    CheckedBoxes,
    Motion,
    StepBoxes,
    StepError,
    StepPositions,
    check_boxes,
)
from dqslam.recording import pose_model_of, pose_size

_NO_FLOATS = np.zeros(0)


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
        Of the steps: how many poses are minimized, and when.
    pose_model
        SE2 or SE3; by default that of ``first_pose``, and without one that of the first motion:
        until then the plane is assumed.
    first_pose, first_covariance
        world_from_robot of the first step, the origin by default, and its covariance (k, k), by
        default none: it is exact.
    box_noise, size_prior, scene_priors
        What is assumed, as ``build_graph`` has it.
    trust_ids
        The probability that an id stays with its object; 1 takes ids for final. Below, and for
        boxes without ids, boxes find their objects as ``associate`` has it.
    finds_movers
        Whether objects whose ids are final must show that they are at rest, too: their boxes wait
        for four views, and objects that move are left out.
    estimates_noise
        Whether the level of the odometry's noise is estimated from such boxes, and the covariances
        of the steps are not believed.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> slam = dq.OnlineSlam(recording.camera)
    >>> for step in dq.steps_of(recording):
    ...     report = slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    >>> slam
    OnlineSlam(SE2, 253 steps, 10 objects)
    >>> slam.polish().result().summary.converged
    True
    """

    def __init__(
        self,
        camera: _core.Camera,
        options: _core.SolveOptions | None = None,
        *,
        online: _core.OnlineOptions | None = None,
        pose_model: _core.PoseModel | None = None,
        first_pose: ArrayLike | None = None,
        first_covariance: ArrayLike | None = None,
        box_noise: BoxNoise | None = None,
        size_prior: SizePrior | SizePriors | None = None,
        scene_priors: _core.ScenePriors | None = None,
        trust_ids: float = FINAL,
        finds_movers: bool = False,
        estimates_noise: bool = False,
    ) -> None:
        """Begin a session without a step."""
        self._arguments = {name: value for name, value in locals().items() if name != "self"}
        require(camera, _core.Camera, "OnlineSlam", "OnlineSlam(recording.camera)")
        self._may_leave_plane = pose_model is None and first_pose is None
        if pose_model is None:
            given = np.zeros(3) if first_pose is None else first_pose
            pose_model = pose_model_of("first_pose", given)
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
        self._begin = PathBegin(pose_model, first_pose, first_covariance)
        self.shown: Ints = np.zeros(0, dtype=np.int64)
        """Object that each box of the last step was given, -1 for one that waits; shape (b,)."""
        self._ids: list[Ints] = []
        self._polisher = Polisher()
        self._map_rows = 0
        self._map_covariance: dict[int, Floats] = {}
        if not 0.5 < trust_ids <= FINAL:
            raise ValueError(f"trust in ids is {trust_ids:g}, not above 0.5 and at most 1")
        self._believes_ids = trust_ids == FINAL and not finds_movers
        self._estimates_noise = estimates_noise
        self._journal = Journal(size_prior)
        assumptions = Assumptions(
            camera,
            pose_model,
            self._box_noise,
            learns_size=size_prior is None,
            estimates_noise=estimates_noise,
        )
        trust = FINAL if trust_ids == FINAL and finds_movers else min(trust_ids, UNSURE)
        self._identifier = Identifier(assumptions, self._journal, trust=trust)
        if not self._believes_ids:
            import scipy.optimize  # noqa: F401, half a second that no step should take

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
        for given, kind in ((odometry, Motion), (boxes, StepBoxes), (positions, StepPositions)):
            if given is not None:
                hint = "slam.add(step.odometry, step.boxes, timestamp=step.timestamp)"
                require(given, kind, "OnlineSlam.add", hint)
        if not self._timestamps:
            self._first_step = (boxes, timestamp, positions)
        elif self._may_leave_plane and odometry is not None:
            self._settle_pose_model(odometry)
        self._polisher.take()
        count = len(self._timestamps)
        try:
            time = next_time(self._timestamps[-1] if count else None, timestamp)
            checked = check_boxes(boxes)
            relative, covariance = motion_arrays(
                odometry,
                None if count else self._begin,
                self._step_covariance(),
            )
            shows = checked.object_id if self._believes_ids else np.full(len(checked.box), -1)
            known = np.flatnonzero(shows >= 0)
            ids = shows[known].tolist()
            names = [checked.class_name[row] for row in known.tolist()]
            rows, new = self._registry.rows(ids, names)
            objects = np.full(len(shows), -1, dtype=np.int32)
            objects[known] = rows
            report = self._session.add(
                relative,
                covariance,
                objects,
                checked.box,
                box_noise_rows(self._box_noise, checked.box),
                checked.truncated,
                *position_rows(positions, self._registry),
                np.array([prior.log_mean for _, prior in new]) if new else _NO_FLOATS,
                np.array([prior.log_sigma for _, prior in new]) if new else _NO_FLOATS,
            )
        except (ValueError, TypeError) as error:
            raise StepError(f"step {count}: {error}") from None
        self._registry.register(new)
        for row, name in zip(rows, names, strict=True):
            self._registry.votes[row][name] += 1
        self._timestamps.append(time)
        self.shown = checked.object_id
        self._ids.append(checked.object_id)
        if self._identifier.has_begun and count:
            self._identifier.go_on(relative, covariance)
        if len(ids) < len(objects):
            unknown = np.flatnonzero(objects < 0)
            objects[unknown] = self._identify(checked, unknown, report.first_observation)
            names_of = self._registry.ids
            self.shown = np.array(
                [names_of[row] if row >= 0 else -1 for row in objects.tolist()], dtype=np.int64
            )
        return report

    def _settle_pose_model(self, odometry: Motion) -> None:
        """Begin again in space if that is where the first motion is."""
        self._may_leave_plane = False
        if np.shape(odometry.relative) == (pose_size(_core.PoseModel.SE3),):
            space = OnlineSlam(**self._arguments | {"pose_model": _core.PoseModel.SE3})
            boxes, timestamp, positions = self._first_step
            space.add(None, boxes, timestamp=timestamp, positions=positions)
            vars(self).update(vars(space))

    def _step_covariance(self) -> Floats | None:
        """Return the covariance that is estimated of a step, (k, k), if it is."""
        noise = self.odometry_noise
        if noise is None:
            return None
        axes = (2, 1) if self.pose_model == _core.PoseModel.SE2 else (3, 3)
        return np.diag(np.repeat([noise.translation_m**2, noise.rotation_rad**2], axes))

    def _identify(self, boxes: CheckedBoxes, rows: Ints, first_observation: int) -> Ints:
        """Return the rows of the objects that boxes show, -1 for none, shape (b,)."""
        return self._identifier.look(
            self._session,
            self._registry,
            self._timestamps[-1],
            NewBoxes(
                row=rows,
                sight=first_observation + rows,
                box=boxes.box[rows],
                truncated=boxes.truncated[rows],
                class_name=[boxes.class_name[row] for row in rows.tolist()],
                claim=boxes.object_id[rows],
            ),
        )

    # ------------------------------------------------------------------------------ estimate

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._timestamps)

    def __repr__(self) -> str:
        """Show the pose model, and how many steps and objects there are."""
        steps, objects = counted(len(self), "step"), counted(self.count, "object")
        return f"OnlineSlam({self.pose_model.name}, {steps}, {objects})"

    @property
    def pose(self) -> Floats:
        """world_from_robot now, shape (d,); the first pose before any step."""
        if not self._timestamps:
            return np.asarray(self._begin.pose)
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
        return int(self._session.num_objects) - len(self._journal.hidden())

    def _rows(self) -> list[int]:
        """Return the rows of the objects that are in the map."""
        hidden = self._journal.hidden()
        return [row for row in range(self._session.num_objects) if row not in hidden]

    @property
    def objects(self) -> Objects:
        """The objects as they stand."""
        rows = self._rows()
        names = self._registry.class_names()
        return Objects(
            ids=np.array([self._registry.ids[row] for row in rows], dtype=np.int64),
            class_names=tuple(names[row] for row in rows),
            ellipsoids=self._session.ellipsoids[rows],
            observations=self._session.observations[rows].astype(np.int64),
        )

    @property
    def left_out(self) -> dict[int, str]:
        """Ids of objects that do not fit a world at rest, and why; their boxes take no part."""
        return {self._registry.ids[row]: why for row, why in self._journal.left_out.items()}

    @property
    def assignments(self) -> list[Ints]:
        """Which object each box of each step shows, as far as is known now; -1 for none."""
        ids = np.array([*self._registry.ids, -1], dtype=np.int64)
        shown = list(self._ids)
        for step, (boxes, rows) in self._journal.shown().items():
            shown[step] = shown[step].copy()
            shown[step][boxes] = ids[rows]
        return shown

    @property
    def keyframes(self) -> Ints:
        """Steps whose boxes take part, of boxes that no id tells the object of; shape (f,)."""
        return np.array([frame.pose for frame in self._journal.keyframes], dtype=np.int64)

    @property
    def size_prior(self) -> SizePrior | SizePriors:
        """What is assumed of new objects: given, or learned from those that boxes told."""
        return self._journal.size_prior or self._registry.size_prior

    @property
    def odometry_noise(self) -> OdometryNoise | None:
        """Of a step, where that is estimated."""
        return self._journal.odometry_noise if self._estimates_noise else None

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
            dropped=dict(sorted(self.left_out.items())),
        )

    # ------------------------------------------------------------------------------ polish

    def polish(self, *, background: bool = False) -> Future[Polished]:
        """Minimize all that has arrived, as ``solve`` does, from where the session stands.

        In the background, the result is merged at the first ``add`` after it is done: what arrived
        meanwhile moves along rigidly. ``result()`` of what is returned waits for it. Without steps
        or boxes there is nothing to do.
        """
        self._polisher.take(wait=True)
        return self._polisher.start(self._new_polish(), background=background)

    def _new_polish(self) -> Polish:
        if self._map_rows:
            return Smoothing(self._session)
        if self._identifier.has_begun:
            return self._identifier.polish(self._session, self._registry, self.solve_options)
        return Solve(self._session, self.solve_options)

    # ------------------------------------------------------------------------------ maps

    def relocalize(self, boxes: StepBoxes) -> Relocation:
        """Find the pose from which boxes of known objects, or classes, were seen.

        Raises
        ------
        ValueError
            With too few boxes of the map, when no pose explains them, or when two do.
        """
        checked = check_boxes(boxes)
        covariances = self._covariances()
        rows = enumerate(self._rows())
        return relocalize(
            self.camera,
            self.pose_model,
            self.objects,
            {place: covariances[row] for place, row in rows if row in covariances},
            checked,
            box_noise_rows(self._box_noise, checked.box),
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

        rows = self._rows()
        covariances = self._covariances()
        by_id = {self._registry.ids[row]: covariances[row] for row in rows if row in covariances}
        save_session(self, by_id, directory)

    @classmethod
    def load(
        cls,
        directory: str | Path,
        options: _core.SolveOptions | None = None,
        *,
        pose_model: _core.PoseModel | None = None,
        robot_from_camera: ArrayLike | None = None,
        first_pose: ArrayLike | None = None,
        first_covariance: ArrayLike | None = None,
        first_boxes: StepBoxes | None = None,
        box_noise: BoxNoise | None = None,
        online: _core.OnlineOptions | None = None,
        size_prior: SizePrior | SizePriors | None = None,
        scene_priors: _core.ScenePriors | None = None,
        trust_ids: float = FINAL,
        finds_movers: bool = False,
    ) -> OnlineSlam:
        """Continue a map that was saved: its objects, with their covariances, are what is known.

        Where the session begins is found from ``first_boxes``, or given; ``first_boxes`` are then
        the first step. ``robot_from_camera`` is the mount, which no result has. The pose model is
        that of ``first_pose``, or SE2 unless it is given.

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
            found = probe.relocalize(first_boxes)
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
            trust_ids=trust_ids,
            finds_movers=finds_movers,
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
            self._journal.know_map_object(len(self._registry.ids) - 1, name, covariance)
        self._map_rows = len(self._registry.ids)
        self._may_leave_plane = False


def _with_loss(online: _core.OnlineOptions, loss_scale: float) -> _core.OnlineOptions:
    """Return the same options with a loss on boxes."""
    names = [name for name in dir(online) if not name.startswith("_")]
    return _core.OnlineOptions(
        **{name: getattr(online, name) for name in names} | {"loss_scale": loss_scale}
    )
