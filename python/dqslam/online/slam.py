"""A session as users have it: steps in, an estimate at any time out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, Ints, require
from dqslam._repr import counted
from dqslam.association import FINAL, UNSURE
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.online.identify import Identifier
from dqslam.online.inputs import path_begin
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.maps import add_map, load_map, save_map
from dqslam.online.objects import Objects, Registry
from dqslam.online.polish import Polished, Polisher, smooth_all, solve_all
from dqslam.online.readout import read_assignments, read_estimate, read_objects
from dqslam.online.refinement import refine_all
from dqslam.online.relocalize import Relocation, relocalize
from dqslam.online.state import Settings, State
from dqslam.online.step import Motion, StepBoxes, StepMeasurements, StepPositions
from dqslam.online.stepping import take_step
from dqslam.recording import pose_model_of, pose_size


class OnlineSlam:
    """Object SLAM step by step.

    Each ``add`` does bounded work. After it, ``pose``, ``poses`` and ``objects`` have an estimate.
    Objects have a size prior from their first box, so the estimate is always determined.

    Parameters
    ----------
    camera
        The camera of undistorted boxes, and its mount on the robot.
    options
        Options of the solver for ``polish``. With any loss but ``NONE``, steps are robust too.
    online
        Options of the steps: how many poses are minimized, and when.
    pose_model
        SE2 or SE3. The default is that of ``first_pose``, or else that of the first motion; until
        then it is SE2.
    first_pose, first_covariance
        world_from_robot of the first step, by default the origin, and its covariance (k, k).
        Without a covariance, the first pose is exact.
    box_noise, size_prior, scene_priors
        Assumptions, as for ``build_graph``.
    trust_ids
        The probability that an id stays with its object; with 1, ids are final. With less, and for
        boxes without ids, boxes are assigned to objects as in ``associate``.
    finds_movers
        Whether objects with final ids are tested for motion as well. Their boxes wait for four
        views, and objects that move are left out.
    estimates_noise
        Whether the level of the odometry's noise is estimated from such boxes, instead of using the
        covariances of the steps.

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
        """Begin a session that has no step yet."""
        self._arguments = {name: value for name, value in locals().items() if name != "self"}
        require(camera, _core.Camera, "OnlineSlam", "OnlineSlam(recording.camera)")
        if not 0.5 < trust_ids <= FINAL:
            raise ValueError(f"trust in ids is {trust_ids:g}, not above 0.5 and at most 1")
        self._may_leave_plane = pose_model is None and first_pose is None
        if pose_model is None:
            given = np.zeros(3) if first_pose is None else first_pose
            pose_model = pose_model_of("first_pose", given)
        self.camera = camera
        self.pose_model = pose_model
        plain = _core.SolveOptions(loss=_core.Loss.NONE)
        self.solve_options = plain if options is None else options
        if self.solve_options.landmark_model != _core.LandmarkModel.ELLIPSOID:
            raise ValueError("online: only the ellipsoid model has a prior on size")
        online = _core.OnlineOptions() if online is None else online
        if self.solve_options.loss != _core.Loss.NONE and online.loss_scale == 0.0:
            online = _with_loss(online, self.solve_options.loss_scale)
        scene = _core.ScenePriors() if scene_priors is None else scene_priors
        are_final = trust_ids == FINAL
        settings = Settings(
            camera=camera,
            pose_model=pose_model,
            solve_options=self.solve_options,
            box_noise=BoxNoise() if box_noise is None else box_noise,
            size_prior=size_prior,
            believes_ids=are_final and not finds_movers,
            trust=FINAL if are_final and finds_movers else min(trust_ids, UNSURE),
            estimates_noise=estimates_noise,
        )
        self._state = State(
            settings,
            path_begin(pose_model, first_pose, first_covariance),
            _core.Session(pose_model, camera, scene, online),
            Registry(),
            KeyframeStore(size_prior),
        )
        self._identifier = Identifier(self._state)
        self._polisher = Polisher()
        if not settings.believes_ids:
            import scipy.optimize  # noqa: F401, half a second that no step should take

    def add(
        self,
        odometry: Motion | None,
        boxes: StepBoxes | None = None,
        *,
        timestamp: float | None = None,
        positions: StepPositions | None = None,
        measurements: Sequence[StepMeasurements] = (),
    ) -> _core.StepReport:
        """Add a step and update the estimate.

        Parameters
        ----------
        odometry
            The motion since the step before; None for the first step only.
        boxes
            None or empty for a step without boxes. A box of object -1 is assigned to the object
            that it clearly shows, or to a new one when enough of them agree.
        timestamp
            Seconds, later than the step before; by default one second later.
        positions, measurements
            Other measurements of objects that boxes have shown.

        Raises
        ------
        StepError
            If the time does not increase, if odometry is missing, if numbers are not finite, or if
            a box is invalid. The session is then unchanged.
        """
        for given, kind in ((odometry, Motion), (boxes, StepBoxes), (positions, StepPositions)):
            if given is not None:
                hint = "slam.add(step.odometry, step.boxes, timestamp=step.timestamp)"
                require(given, kind, "OnlineSlam.add", hint)
        if not len(self):
            self._first_step = (boxes, timestamp, positions, measurements)
        elif self._may_leave_plane and odometry is not None:
            self._settle_pose_model(odometry)
        self._polisher.take()
        return take_step(
            self._state, self._identifier, odometry, boxes, timestamp, positions, measurements
        )

    def _settle_pose_model(self, odometry: Motion) -> None:
        """Begin again in SE(3) if the first motion is in SE(3)."""
        self._may_leave_plane = False
        if np.shape(odometry.relative) == (pose_size(_core.PoseModel.SE3),):
            space = OnlineSlam(**self._arguments | {"pose_model": _core.PoseModel.SE3})
            boxes, timestamp, positions, measurements = self._first_step
            space.add(
                None,
                boxes,
                timestamp=timestamp,
                positions=positions,
                measurements=measurements,
            )
            vars(self).update(vars(space))

    # ------------------------------------------------------------------------------ estimate

    def __repr__(self) -> str:
        """Show the pose model, and how many steps and objects there are."""
        steps, objects = counted(len(self), "step"), counted(self.num_objects, "object")
        return f"OnlineSlam({self.pose_model.name}, {steps}, {objects})"

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self._state.timestamps)

    @property
    def timestamps(self) -> Floats:
        """Seconds, shape (n,)."""
        return np.array(self._state.timestamps)

    @property
    def pose(self) -> Floats:
        """world_from_robot of the last step, shape (d,); the first pose before any step."""
        if not len(self):
            return self._state.begin[0]
        return np.asarray(self._state.core.pose_at(len(self) - 1))

    @property
    def poses(self) -> Floats:
        """world_from_robot of every step, shape (n, d)."""
        return self._state.core.poses

    @property
    def objects(self) -> Objects:
        """The present estimate of the objects."""
        return read_objects(self._state)

    @property
    def num_objects(self) -> int:
        """The number of objects."""
        return len(self._state.object_rows)

    @property
    def left_out(self) -> dict[int, str]:
        """Reasons why objects do not fit a world at rest, by id; their boxes are not used."""
        return self._state.left_out

    @property
    def shown(self) -> Ints:
        """Id of the object that each box of the last step shows, -1 if it waits; shape (b,)."""
        return self._state.shown

    @property
    def assignments(self) -> list[Ints]:
        """Id of the object that each box of each step shows, as known now; -1 for none."""
        return read_assignments(self._state)

    @property
    def keyframes(self) -> Ints:
        """Steps that are keyframes of the association, shape (f,)."""
        return np.array([one.pose for one in self._state.store.keyframes], dtype=np.int64)

    @property
    def size_prior(self) -> SizePrior | SizePriors:
        """The size prior of new objects, which is given or learned from earlier objects."""
        return self._state.store.size_prior or self._state.prior

    @property
    def odometry_noise(self) -> OdometryNoise | None:
        """The estimated noise of a step; None if it is not estimated."""
        return self._state.odometry_noise

    def estimate(self) -> Estimate:
        """Return the estimate in the form of ``solve``, with objects by ascending ids."""
        return read_estimate(self._state)

    def polish(self, *, background: bool = False) -> Future[Polished]:
        """Solve the complete problem, starting from the state of the session.

        In the background, the result is merged at the first ``add`` after it is done. Poses that
        arrived in the meantime move rigidly with it. ``result()`` of the returned future waits for
        the result. Without steps or boxes, nothing is done.
        """
        self._polisher.take(wait=True)
        state = self._state
        if state.store.map_covariance:
            polish = smooth_all(state.core)
        elif state.store.keyframes:
            polish = refine_all(state)
        else:
            polish = solve_all(state.core, self.solve_options)
        return self._polisher.start(polish, background=background)

    # ------------------------------------------------------------------------------ maps

    def relocalize(self, boxes: StepBoxes) -> Relocation:
        """Find the pose from which boxes of mapped objects were seen, by their ids or classes.

        Raises
        ------
        ValueError
            If there are too few boxes of mapped objects, or if not exactly one pose explains them.
        """
        return relocalize(self._state, boxes)

    def save(self, directory: str | Path) -> None:
        """Write the estimate and its covariances, as ``save_estimate`` does."""
        save_map(self._state, directory)

    @classmethod
    def load(
        cls,
        directory: str | Path,
        options: _core.SolveOptions | None = None,
        *,
        robot_from_camera: ArrayLike | None = None,
        first_boxes: StepBoxes | None = None,
        **settings: Any,
    ) -> Self:
        """Continue a saved map: its objects and their covariances are priors of the new session.

        Parameters
        ----------
        robot_from_camera
            Mount of the camera, which results do not have; by default the identity.
        first_boxes
            Boxes of the first step. Without a ``first_pose``, they determine the first pose.
        settings
            Further arguments of a new session.

        Raises
        ------
        FileError
            If results are missing or wrong.
        ValueError
            If not exactly one pose explains the boxes.
        """
        known = load_map(directory, robot_from_camera)
        slam = cls(known.camera, options, **settings)
        add_map(slam._state, known)
        slam._may_leave_plane = False
        if first_boxes is not None:
            if settings.get("first_pose") is None:
                found = slam.relocalize(first_boxes)
                slam._state.begin = path_begin(slam.pose_model, found.pose, found.covariance)
                first_boxes = found.with_ids(first_boxes)
            slam.add(None, first_boxes)
        return slam


def _with_loss(online: _core.OnlineOptions, loss_scale: float) -> _core.OnlineOptions:
    """Return the options with another scale of the loss on boxes."""
    names = [name for name in dir(online) if not name.startswith("_")]
    return _core.OnlineOptions(
        **{name: getattr(online, name) for name in names} | {"loss_scale": loss_scale}
    )
