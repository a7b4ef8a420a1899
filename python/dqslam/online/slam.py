"""A session as users have it: steps in, an estimate at any time out."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from pathlib import Path
from threading import RLock, Thread
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import require
from dqslam.association import FINAL, UNSURE
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.online.identify import Identifier
from dqslam.online.inputs import path_begin
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.locked import locked
from dqslam.online.maps import MapOfSession, add_map, load_map
from dqslam.online.objects import Registry
from dqslam.online.polish import Polish, Polished, Polisher, smooth_all, solve_all
from dqslam.online.reader import SessionReader
from dqslam.online.refinement import refine_all
from dqslam.online.relocalize import Relocation, relocalize
from dqslam.online.state import Settings, State, with_loss
from dqslam.online.step import Motion, StepBoxes, StepMeasurements, StepPositions
from dqslam.online.stepping import check_step, take_step
from dqslam.recording import pose_model_of, pose_size

_IN_SPACE = (pose_size(_core.PoseModel.SE3),)


class OnlineSlam(SessionReader):
    """Object SLAM step by step.

    Each ``add`` does bounded work. After it, ``pose``, ``poses`` and ``objects`` have an estimate.
    Objects have a size prior from their first box, so the estimate is always determined.

    Any number of threads may use a session. One lock lets a method wait until no other thread is in
    one, so that readers never see half a step. A polish, in the background or not, works on a copy
    and holds the lock only while it begins and while its result is merged.

    Parameters
    ----------
    camera
        The camera of undistorted boxes, and its mount on the robot.
    options
        Options of the solver for ``polish``. With any loss but ``NONE``, steps are robust too:
        they use a Cauchy loss of the same scale.
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
        self._lock = RLock()
        require(camera, _core.Camera, "OnlineSlam", "OnlineSlam(recording.camera)")
        if not 0.5 < trust_ids <= FINAL:
            raise ValueError(f"trust in ids is {trust_ids:g}, not above 0.5 and at most 1")
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
            online = with_loss(online, self.solve_options.loss_scale)
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
        begin = path_begin(pose_model, first_pose, first_covariance)
        self._state = State(
            settings,
            begin,
            _core.Session(pose_model, camera, scene, online),
            Registry(),
            KeyframeStore(size_prior),
            odometry_end=begin[0],
        )
        self._identifier = Identifier(self._state)
        self._polisher = Polisher()
        if not settings.believes_ids:
            import scipy.optimize  # noqa: F401, half a second that no step should take

    @locked
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
            If the time does not increase, if odometry is missing, if numbers are not finite or
            beyond their limits (docs/reliability.md), or if a box is invalid or outside the image.
            The session is then unchanged, to the bit.
        """
        for given, kind in ((odometry, Motion), (boxes, StepBoxes), (positions, StepPositions)):
            if given is not None:
                hint = "slam.add(step.odometry, step.boxes, timestamp=step.timestamp)"
                require(given, kind, "OnlineSlam.add", hint)
        step = (odometry, boxes, timestamp, positions, measurements)
        is_unsettled = len(self) > 0 and self._may_leave_plane
        if is_unsettled and odometry is not None and np.shape(odometry.relative) == _IN_SPACE:
            return self._begin_in_space(step)
        is_done = self._polisher.is_done
        checked, prepared = check_step(self._state, *step, dry_run=is_done)
        if not len(self):  # copied, because the caller may write the next image into its arrays
            self._first_step = copy.deepcopy(step)
        elif odometry is not None:
            self._may_leave_plane = False
        if is_done:
            self._polisher.take()
        return take_step(self._state, self._identifier, checked, prepared)

    def _begin_in_space(self, step: tuple[Any, ...]) -> _core.StepReport:
        """Begin again in SE(3), because the first motion is; nothing changes if it is refused."""
        space = OnlineSlam(**self._arguments | {"pose_model": _core.PoseModel.SE3})
        for one in (self._first_step, step):
            odometry, boxes, timestamp, positions, measurements = one
            report = space.add(
                odometry,
                boxes,
                timestamp=timestamp,
                positions=positions,
                measurements=measurements,
            )
        vars(self).update({k: value for k, value in vars(space).items() if k != "_lock"})
        return report

    def polish(self, *, background: bool = False) -> Future[Polished]:
        """Solve the complete problem, starting from the state of the session.

        In the background, the result is merged at the first ``add`` after it is done. Poses that
        arrived in the meantime move rigidly with it. ``result()`` of the returned future waits for
        the result. Without steps or boxes, nothing is done.
        """
        work, found = self._begin_polish()
        if background:
            Thread(target=work, name="dqslam-polish", daemon=True).start()
            return found
        work()
        self._merge_polish()
        found.result()
        return found

    def _begin_polish(self) -> tuple[Callable[[], None], Future[Polished]]:
        """Prepare a polish when none is running; others may use the session until then."""
        while True:
            with self._lock:
                running = self._polisher.running
                if running is None:
                    return self._polisher.begin(self._prepare_polish())
            wait([running])

    def _prepare_polish(self) -> Polish:
        self._polisher.take()
        state = self._state
        if state.store.map_covariance:
            return smooth_all(state.core)
        if state.store.keyframes:
            return refine_all(state)
        return solve_all(state.core, self.solve_options)

    @locked
    def _merge_polish(self) -> None:
        self._polisher.take()

    # ------------------------------------------------------------------------------ maps

    @locked
    def relocalize(self, boxes: StepBoxes) -> Relocation:
        """Find the pose from which boxes of mapped objects were seen, by their ids or classes.

        Raises
        ------
        ValueError
            If there are too few boxes of mapped objects, or if not exactly one pose explains them.
        """
        return relocalize(self._state, boxes)

    def save(self, directory: str | Path) -> None:
        """Write the estimate and its covariances, as ``save_estimate`` does.

        Steps may be added meanwhile. They are not in the files.
        """
        with self._lock:
            found = MapOfSession.of(self._state)
        found.save(directory)

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
            Mount of the camera, by default that of the problem in the folder (``graph.npz``), or
            else the identity.
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
                begin = path_begin(slam.pose_model, found.pose, found.covariance)
                slam._state.begin, slam._state.odometry_end = begin, begin[0]
                first_boxes = found.with_ids(first_boxes)
            slam.add(None, first_boxes)
        return slam
