"""The map while it is made: poses, objects, which box shows which, and how well all is known."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association.gating import CONFUSED
from dqslam.association.noise import StepNoise, corrected
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.graph import Graph, build_graph
from dqslam.recording import Recording

# Of an object that nothing is known of yet: a hand's breadth to a car.
ANY_SIZE = SizePrior(log_mean=float(np.log(0.3)), log_sigma=1.5)
# Within a recording, logarithms of sizes spread by 0.3 to 0.65.
LOG_SIZE_SIGMA = 0.7
# Objects whose sizes tell that of others.
ENOUGH_SIZES = 3


class Outcome(NamedTuple):
    """What an estimate would be."""

    cost: float
    """Half the sum of squared residuals, in sigmas, after the loss."""
    poses: NDArray[np.float64]
    """Shape (n, d)."""


class SceneMap:
    """Poses and objects, as far as a path has been followed.

    Objects keep their row for good; one that is given up has no boxes any more.
    """

    def __init__(
        self,
        recording: Recording,
        tracklet: NDArray[np.int64],
        *,
        box_noise: BoxNoise,
        size_prior: SizePrior | SizePriors | None = None,
        step_noise: StepNoise | None = None,
        odometry_noise: OdometryNoise | None = None,
        mode: _core.Mode = _core.Mode.SLAM,
    ) -> None:
        """Start at the first pose.

        Parameters
        ----------
        tracklet
            Of each box, shape (m,).
        size_prior
            By default it is learned from the objects found.
        step_noise
            By default the covariance of the recording's odometry is believed; else its level is
            estimated, from ``odometry_noise`` on.
        mode
            MAPPING takes the odometry for the truth.
        """
        detections = recording.detections
        self.recording = recording
        self.tracklet = tracklet.copy()
        self.box_noise = box_noise
        self.box_covariance = box_noise.covariance(detections.box)
        self.mode = mode
        self.learns_size = size_prior is None
        self.size_prior = ANY_SIZE if size_prior is None else size_prior
        self.step_noise = step_noise
        self.odometry_noise = odometry_noise or OdometryNoise()
        self._believe_noise()
        self.classes = np.array(sorted(detections.class_names))
        self.box_class = np.searchsorted(self.classes, detections.class_id)
        self.poses = recording.odometry.first_pose[None]
        self.ellipsoids = np.zeros((0, 9))
        self.box_object = np.full(len(detections), -1)
        self.box_name = np.arange(len(detections))
        """What a box is called as long as the map lives, shape (m,)."""
        self.free_tracklet = int(tracklet.max(initial=-1)) + 1
        """Numbers from here on are free."""
        self.votes = np.zeros((0, len(self.classes)), dtype=np.int64)
        """How often each object was called each class, shape (o, c)."""
        self.object_of_tracklet: dict[int, int] = {}
        self.left_out: dict[int, str] = {}
        """Objects that take no part in the estimate, and why."""
        self.joined: dict[int, int] = {}
        """Objects that were given up for another, and for which."""
        self.prior_covariance: dict[int, NDArray[np.float64]] = {}
        """Of objects that were known before there were boxes, (9, 9)."""

    # ---- objects and their boxes

    @property
    def box_counts(self) -> NDArray[np.int64]:
        """Boxes of each object, shape (o,)."""
        return np.asarray(self.votes.sum(axis=1))

    def claim(self, rows: NDArray[np.int64], numbers: NDArray[np.int64]) -> None:
        """Give free boxes to objects (b,), or to none where the number is -1."""
        rows, numbers = rows[numbers >= 0], numbers[numbers >= 0]
        self.box_object[rows] = numbers
        np.add.at(self.votes, (numbers, self.box_class[rows]), 1)

    def release(self, rows: NDArray[np.int64]) -> None:
        """Take boxes (b,) from their objects."""
        rows = rows[self.box_object[rows] >= 0]
        np.add.at(self.votes, (self.box_object[rows], self.box_class[rows]), -1)
        self.box_object[rows] = -1

    def cut_tracklet(self, tracklet: int, pose: int) -> None:
        """Give the boxes of a tracklet from a pose on a number of their own."""
        late = self.recording.detections.pose >= pose
        self.tracklet[(self.tracklet == tracklet) & late] = self.free_tracklet
        self.free_tracklet += 1

    def release_all(self) -> None:
        """Take all boxes from their objects, and forget which tracklet shows which."""
        self.box_object[:] = -1
        self.votes[:] = 0
        self.object_of_tracklet = {}

    def are_strangers(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell which boxes (b,) wait, of tracklets without an object."""
        known = np.isin(self.tracklet[rows], list(self.object_of_tracklet))
        return (self.box_object[rows] < 0) & ~known

    def class_probability(
        self, rows: NDArray[np.int64], objects: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return the probability of the class of boxes (b,) for objects (p,), shape (b, p)."""
        votes = self.votes[objects]
        share = votes / np.maximum(votes.sum(axis=1, keepdims=True), 1)
        return np.asarray(np.maximum(share, CONFUSED)[:, self.box_class[rows]].T)

    def log_sizes(self) -> NDArray[np.float64]:
        """Return the mean logarithm of each object's semi-axes [m], shape (o,)."""
        axes = [_core.axes_from_ellipsoid(row)[1] for row in self.ellipsoids]
        return np.asarray(np.log(np.array(axes).reshape(-1, 3)).mean(axis=1))

    def add_object(self, ellipsoid: NDArray[np.float64], rows: NDArray[np.int64]) -> None:
        """Add an object and its first boxes."""
        self.ellipsoids = np.concatenate([self.ellipsoids, ellipsoid[None]])
        self.votes = np.concatenate(
            [self.votes, np.zeros_like(self.votes, shape=(1, len(self.classes)))]
        )
        number = len(self.ellipsoids) - 1
        self.claim(rows, np.full(len(rows), number))
        for tracklet in np.unique(self.tracklet[rows]).tolist():
            self.object_of_tracklet[tracklet] = number

    def join_objects(self, kept: int, given_up: int) -> None:
        """Make two objects one."""
        self.box_object[self.box_object == given_up] = kept
        self.votes[kept] += self.votes[given_up]
        self.votes[given_up] = 0
        self.joined[given_up] = kept
        for tracklet, number in self.object_of_tracklet.items():
            if number == given_up:
                self.object_of_tracklet[tracklet] = kept

    def give_up(self, number: int) -> None:
        """Let the boxes of an object wait for another."""
        self.box_object[self.box_object == number] = -1
        self.votes[number] = 0
        kept = {t: n for t, n in self.object_of_tracklet.items() if n != number}
        self.object_of_tracklet = kept

    # ---- poses and estimates

    def extend(self, end: int) -> None:
        """Follow the odometry to the poses before ``end``."""
        odometry = self.recording.odometry
        known = len(self.poses)
        steps = odometry.relative[known - 1 : end - 1]
        ahead = _core.dead_reckon(odometry.pose_model, self.poses[-1], steps)
        self.poses = np.concatenate([self.poses, ahead[1:]])

    def graph(self, end: int | None = None) -> Graph | None:
        """Lay out the poses before ``end`` and the objects that take part; None without any."""
        end = len(self.poses) if end is None else end
        takes_part = np.ones(len(self.ellipsoids) + 1, dtype=bool)
        takes_part[[*self.left_out, -1]] = False
        seen = self.recording.detections.pose < end
        rows = np.flatnonzero(seen & takes_part[self.box_object])
        return self._graph_of(rows, self.box_object[rows], end=end) if rows.size else None

    def state(self, graph: Graph) -> _core.State:
        """Return the poses and objects of a graph of this map, as estimated."""
        return _core.State(self.poses[: len(graph.timestamps)], self.ellipsoids[graph.object_ids])

    def estimate(self, *, max_iterations: int) -> None:
        """Improve all poses and objects so far, and learn how large objects are."""
        graph = self.graph()
        if graph is None:
            self.poses = self._path_by_odometry()
            return
        options = self._options()
        options.max_iterations = max_iterations
        solution = _core.solve(graph.core, options, self.state(graph))
        self.poses = solution.poses
        self.ellipsoids[graph.object_ids] = solution.landmarks
        self.learn_size(graph.object_ids)

    def learn_size(self, objects: NDArray[np.int64]) -> None:
        """Learn how large objects are from some of them, (o,), unless that was given."""
        if self.learns_size and len(objects) >= ENOUGH_SIZES:
            log_size = float(np.median(self.log_sizes()[objects]))
            self.size_prior = SizePrior(log_mean=log_size, log_sigma=LOG_SIZE_SIGMA)

    def cost(self, *, max_iterations: int, without: Collection[int] = ()) -> Outcome:
        """Return what an estimate costs without some objects; the map stays as it is."""
        left_out = self.left_out
        self.left_out = left_out | dict.fromkeys(without, "on trial")
        graph = self.graph()
        self.left_out = left_out
        if graph is None:
            return Outcome(0.0, self._path_by_odometry())
        options = self._options()
        options.max_iterations = max_iterations
        solution = _core.solve(graph.core, options, self.state(graph))
        return Outcome(solution.summary.final_cost, solution.poses)

    @contextmanager
    def at(self, poses: NDArray[np.float64]) -> Iterator[None]:
        """Be at other poses for a while."""
        kept, self.poses = self.poses, poses
        try:
            yield
        finally:
            self.poses = kept

    def estimate_noise(self) -> float:
        """Correct the level of the odometry's noise; return the factor it changed by, as a log."""
        graph = self.graph()
        if self.step_noise is None or graph is None or self.mode == _core.Mode.MAPPING:
            return 0.0
        fit = _core.fit(graph.core, self._options(), self.state(graph))
        before, self.odometry_noise = self.odometry_noise, corrected(self.odometry_noise, fit)
        self._believe_noise()
        ratio = np.array([self.odometry_noise.translation_m, self.odometry_noise.rotation_rad])
        ratio /= [before.translation_m, before.rotation_rad]
        return float(np.abs(np.log(ratio)).max())

    def joint_covariance(
        self, pose: int, objects: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return which of some objects take part, and their covariance together with a pose's.

        Shapes (o,) and (k + 9 o, k + 9 o), the tangent of the pose first.
        """
        known = objects[np.isin(objects, list(self.prior_covariance))]
        seen, covariance = self._covariance_of_seen(pose, np.setdiff1d(objects, known))
        if not known.size:
            return seen, covariance
        from scipy.linalg import block_diag

        # How such an object and the path are correlated is not kept.
        priors = [self.prior_covariance[number] for number in known.tolist()]
        return np.concatenate([seen, known]), block_diag(covariance, *priors)

    def _covariance_of_seen(
        self, pose: int, objects: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        graph = self.graph(end=pose + 1)
        if graph is None:
            k = self.recording.odometry.covariance.shape[1]
            return objects[:0], np.zeros((k, k))
        objects = objects[np.isin(objects, graph.object_ids)]
        rows = np.searchsorted(graph.object_ids, objects).tolist()
        state = self.state(graph)
        return objects, _core.joint_covariance(graph.core, self._options(), state, [pose], rows)

    def fit_groups(
        self, groups: list[NDArray[np.int64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Fit an object to each group of boxes, at the poses as they are.

        Return ellipsoids (g, 9) and the covariances of their centers (g, 3, 3), NaN where nothing
        determines them.
        """
        rows = np.concatenate(groups)
        numbers = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
        graph = self._graph_of(rows, numbers, end=len(self.poses), at_estimate=True)
        options = _core.SolveOptions(mode=_core.Mode.MAPPING, loss=_core.Loss.CAUCHY)
        solution = _core.solve(graph.core, options)
        state = _core.State(solution.poses, solution.landmarks)
        try:
            spread = _core.covariance(graph.core, options, state).objects.reshape(-1, 9, 9)
        except RuntimeError:  # a box is undefined: some object is where it cannot be seen
            spread = np.full((len(groups), 9, 9), np.nan)
        return solution.landmarks, spread[:, :3, :3]

    def chi2(
        self, rows: NDArray[np.int64], ellipsoids: NDArray[np.float64], *, blur: float
    ) -> NDArray[np.float64]:
        """Compare boxes with the projections of ellipsoids (b, 9): chi-square with 4 dof, (b,).

        Infinite where the object is not in front of the camera. ``blur`` is the standard deviation,
        in pixels, that is added to the boxes' own.
        """
        detections = self.recording.detections
        covariance = self.box_covariance[rows] + blur**2 * np.eye(4)
        return _core.box_chi_squares(
            self.recording.odometry.pose_model,
            self.recording.camera,
            self.poses[detections.pose[rows]],
            ellipsoids,
            detections.box[rows],
            covariance.reshape(-1, 16),
            detections.truncated[rows],
        )

    # ---- inside

    def _believe_noise(self) -> None:
        if self.step_noise is None:
            return
        covariance = self.step_noise.covariance(self.odometry_noise)
        odometry = replace(self.recording.odometry, covariance=covariance)
        self.recording = replace(self.recording, odometry=odometry)

    def _path_by_odometry(self) -> NDArray[np.float64]:
        """Return the poses so far as odometry alone has them, shape (n, d)."""
        odometry = self.recording.odometry
        steps = odometry.relative[: len(self.poses) - 1]
        return _core.dead_reckon(odometry.pose_model, odometry.first_pose, steps)

    def _graph_of(
        self,
        rows: NDArray[np.int64],
        numbers: NDArray[np.int64],
        *,
        end: int,
        at_estimate: bool = False,
    ) -> Graph:
        """Lay out some boxes as those of objects; odometry as measured, or as estimated."""
        odometry = self.recording.odometry
        relative = odometry.relative[: end - 1]
        if at_estimate:
            model = odometry.pose_model
            relative = _core.between(model, self.poses[: end - 1], self.poses[1:end])
        part = replace(
            self.recording,
            timestamps=self.recording.timestamps[:end],
            odometry=replace(
                odometry, relative=relative, covariance=odometry.covariance[: end - 1]
            ),
            detections=replace(self.recording.detections.select(rows), object_id=numbers),
        )
        return build_graph(part, box_noise=self.box_noise, size_prior=self.size_prior)

    def _options(self) -> _core.SolveOptions:
        """Few, quick steps from where the map stands; outliers are many."""
        return _core.SolveOptions(
            mode=self.mode,
            residual=_core.Residual.BOX,
            loss=_core.Loss.CAUCHY,
            minimizer=_core.Minimizer.LEVENBERG_MARQUARDT,
            function_tolerance=1e-4,
        )
