"""The map while it is made: poses, objects, and how well they are known."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.association.box_levels import corrected_boxes, within_limits
from dqslam.association.gating import GATE
from dqslam.association.labels import Labels
from dqslam.association.noise import StepNoise, corrected
from dqslam.association.occlusion import shortened_edges
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.graph import Graph, build_graph
from dqslam.lens import edge_scales
from dqslam.recording import Recording

# Of an object that nothing is known of yet: a hand's breadth to a car.
ANY_SIZE = SizePrior(log_mean=float(np.log(0.3)), log_sigma=1.5)
# Within a recording, logarithms of sizes spread by 0.3 to 0.65.
LEARNED_LOG_SIZE_SIGMA = 0.7
# The size of objects is learned from so many of them at least: the median of two is no size.
MIN_OBJECTS_TO_LEARN_SIZE = 3
# A level falls to this share of the first at most: less is no noise that boxes could show.
LOWEST_SHARE = 1e-3


class SceneMap:
    """Poses and objects, as far as a path has been followed, and what the boxes show of them."""

    def __init__(
        self,
        recording: Recording,
        labels: Labels,
        *,
        box_noise: BoxNoise,
        learns_box_noise: bool = False,
        size_prior: SizePrior | SizePriors | None = None,
        first_size: SizePrior = ANY_SIZE,
        step_noise: StepNoise | None = None,
        levels: Floats | None = None,
        mode: _core.Mode = _core.Mode.SLAM,
        minds_occlusion: bool = False,
    ) -> None:
        """Start at the first pose, without objects.

        Parameters
        ----------
        labels
            Of the boxes of the recording; the map changes them.
        size_prior
            By default it is learned from the objects found, from ``first_size`` on.
        step_noise
            By default the covariance of the recording's odometry is believed; else the levels of
            its components are estimated, from ``levels`` on, shape (c,).
        mode
            MAPPING takes the odometry for the truth.
        minds_occlusion
            Whether an edge of a box that a nearer object may hide is taken for one-sided.
        """
        detections = recording.detections
        self.recording = recording
        self.labels = labels
        self.minds_occlusion = minds_occlusion
        self.cut_edges = detections.truncated
        """Edges that the border of the image cuts, shape (m, 4)."""
        self.class_names = [name for _, name in sorted(detections.class_names.items())]
        """By columns of the labels' votes."""
        self.observation_rows: Ints = np.arange(len(detections))
        """What the boxes are called beyond this map, shape (m,)."""
        self.box_noise = box_noise
        self.learns_box_noise = learns_box_noise
        self.box_covariance = box_noise.covariance(detections.box, recording.camera)
        self.mode = mode
        self.learns_size = size_prior is None
        self.size_prior = first_size if size_prior is None else size_prior
        self.step_noise = step_noise
        self.levels = np.zeros(0) if levels is None else levels
        self.lowest_levels = LOWEST_SHARE * self.levels
        self.inflation = np.ones(len(recording.odometry.relative))
        """Factors of the covariances of jumps, shape (n - 1,)."""
        self._believe_noise()
        self.poses: Floats = recording.odometry.first_pose[None]
        self.ellipsoids = np.zeros((0, 9))
        self.prior_covariance: dict[ObjectRow, Floats] = {}
        """Of objects that were known before there were boxes, (9, 9)."""

    # ---- objects

    def add_object(self, ellipsoid: Floats, rows: Ints) -> None:
        """Add an object and its first boxes."""
        self.ellipsoids = np.concatenate([self.ellipsoids, ellipsoid[None]])
        self.labels.add_object(rows)

    def log_sizes(self) -> Floats:
        """Return the mean logarithm of each object's semi-axes [m], shape (o,)."""
        axes = [_core.axes_from_ellipsoid(row)[1] for row in self.ellipsoids]
        return np.asarray(np.log(np.array(axes).reshape(-1, 3)).mean(axis=1))

    def learn_size(self, object_rows: Ints) -> None:
        """Learn how large objects are from some of them, (o,), unless that was given."""
        if self.learns_size and len(object_rows) >= MIN_OBJECTS_TO_LEARN_SIZE:
            log_size = float(np.median(self.log_sizes()[object_rows]))
            self.size_prior = SizePrior(log_mean=log_size, log_sigma=LEARNED_LOG_SIZE_SIGMA)

    def flag_hidden_edges(self) -> None:
        """Take edges that a nearer object seems to hide for one-sided, if that is minded.

        Only objects that take part hide others.
        """
        if not self.minds_occlusion:
            return
        recording, shown = self.recording, self.labels.object_rows
        known = np.flatnonzero((self.labels.box_counts > 0) & self.labels.takes_part[:-1])
        place = np.append(np.full(len(self.ellipsoids), -1), -1)
        place[known] = np.arange(len(known))
        seen = np.where(recording.detections.pose < len(self.poses), place[shown], -1)
        hidden = shortened_edges(
            recording,
            self.poses,
            self.ellipsoids[known],
            seen,
            np.diagonal(self.box_covariance, axis1=1, axis2=2),
        )
        detections = replace(recording.detections, truncated=self.cut_edges | hidden)
        self.recording = replace(recording, detections=detections)

    # ---- estimates

    def extend(self, end: int) -> None:
        """Follow the odometry to the poses before ``end``."""
        odometry = self.recording.odometry
        steps = odometry.relative[len(self.poses) - 1 : end - 1]
        ahead = _core.dead_reckon(odometry.pose_model, self.poses[-1], steps)
        self.poses = np.concatenate([self.poses, ahead[1:]])

    def graph(self, end: int | None = None) -> Graph | None:
        """Lay out the poses before ``end`` and the objects that take part; None without any."""
        end = len(self.poses) if end is None else end
        shown = self.labels.object_rows
        seen = self.recording.detections.pose < end
        rows = np.flatnonzero(seen & self.labels.takes_part[shown])
        return self._graph_of(rows, shown[rows], end=end) if rows.size else None

    def state(self, graph: Graph) -> _core.State:
        """Return the poses and objects of a graph of this map, as estimated."""
        return _core.State(self.poses[: len(graph.timestamps)], self.ellipsoids[graph.object_ids])

    def estimate(self, *, max_iterations: int) -> None:
        """Improve all poses and objects so far, and learn how large objects are."""
        graph = self.graph()
        if graph is None:
            self.poses = self._path_by_odometry()
            return
        solution = _core.solve(graph.core, self._options(max_iterations), self.state(graph))
        self.poses = solution.poses
        self.ellipsoids[graph.object_ids] = solution.landmarks
        self.learn_size(graph.object_ids)

    def solve_without(
        self, object_rows: Collection[ObjectRow], *, max_iterations: int
    ) -> tuple[float, Floats]:
        """Return the cost and the poses (n, d) of an estimate that some objects take no part in.

        The cost is half the sum of squared residuals, in sigmas, after the loss. The map stays as
        it is.
        """
        dropped = self.labels.dropped
        self.labels.dropped = dropped | dict.fromkeys(object_rows, "on trial")
        graph = self.graph()
        self.labels.dropped = dropped
        if graph is None:
            return 0.0, self._path_by_odometry()
        solution = _core.solve(graph.core, self._options(max_iterations), self.state(graph))
        return solution.summary.final_cost, solution.poses

    @property
    def odometry_noise(self) -> OdometryNoise | None:
        """Root mean square of the noise of a step, where that is estimated."""
        return None if self.step_noise is None else self.step_noise.typical(self.levels)

    @property
    def noise_levels(self) -> dict[str, float]:
        """Levels of the components of that noise, by their names."""
        names = () if self.step_noise is None else self.step_noise.names
        return dict(zip(names, self.levels.tolist(), strict=True))

    def estimate_noise(self) -> float:
        """Correct the levels of the noise; return how far the odometry's changed, as a log."""
        graph = self.graph()
        if graph is None or (self.step_noise is None and not self.learns_box_noise):
            return 0.0
        fit = _core.fit(graph.core, self._options(), self.state(graph))
        change = 0.0
        if self.step_noise is not None:
            better = corrected(
                self.step_noise, self.levels, self.inflation, fit, lowest=self.lowest_levels
            )
            self.levels, self.inflation, change = better.levels, better.inflation, better.change
            self._believe_noise()
        if self.learns_box_noise:
            self._correct_box_noise(graph, fit)
        return change

    def joint_covariance(self, pose: int, object_rows: Ints) -> tuple[Ints, Floats]:
        """Return which of some objects take part, and their covariance together with a pose's.

        Shapes (o,) and (k + 9 o, k + 9 o), the tangent of the pose first.
        """
        from scipy.linalg import block_diag

        has_prior = np.isin(object_rows, list(self.prior_covariance))
        seen, known = object_rows[~has_prior], object_rows[has_prior]
        graph = self.graph(end=pose + 1)
        if graph is None:
            seen, covariance = seen[:0], np.zeros(self.recording.odometry.covariance.shape[1:])
        else:
            seen = seen[np.isin(seen, graph.object_ids)]
            rows = np.searchsorted(graph.object_ids, seen).tolist()
            covariance = _core.joint_covariance(
                graph.core, self._options(), self.state(graph), [pose], rows
            )
        # How an object with a prior and the path are correlated is not kept.
        priors = [self.prior_covariance[row] for row in known.tolist()]
        return np.append(seen, known), block_diag(covariance, *priors)

    # ---- boxes at given poses

    def fit_groups(self, groups: list[Ints], poses: Floats | None = None) -> tuple[Floats, Floats]:
        """Fit an object to each group of boxes, at poses (n, d), by default the map's.

        Return ellipsoids (g, 9) and the covariances of their centers (g, 3, 3), NaN where nothing
        determines them.
        """
        rows = np.concatenate(groups)
        numbers = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
        path = self.poses if poses is None else poses
        graph = self._graph_of(rows, numbers, end=len(path), path=path)
        options = _core.SolveOptions(mode=_core.Mode.MAPPING, loss=_core.Loss.CAUCHY)
        solution = _core.solve(graph.core, options)
        state = _core.State(solution.poses, solution.landmarks)
        try:
            spread = _core.covariance(graph.core, options, state).objects.reshape(-1, 9, 9)
        except RuntimeError:  # a box is undefined: some object is where it cannot be seen
            spread = np.full((len(groups), 9, 9), np.nan)
        return solution.landmarks, spread[:, :3, :3]

    def chi2(
        self, rows: Ints, ellipsoids: Floats, *, blur: float = 0.0, poses: Floats | None = None
    ) -> Floats:
        """Compare boxes with the projections of ellipsoids (b, 9): chi-square with 4 dof, (b,).

        Infinite where the object is not in front of the camera. ``blur`` is the standard deviation,
        in pixels, that is added to the boxes' own; poses (n, d) are by default the map's.
        """
        detections = self.recording.detections
        covariance = self.box_covariance[rows] + blur**2 * np.eye(4)
        return _core.box_chi_squares(
            self.recording.odometry.pose_model,
            self.recording.camera,
            (self.poses if poses is None else poses)[detections.pose[rows]],
            ellipsoids,
            detections.box[rows],
            covariance.reshape(-1, 16),
            detections.truncated[rows],
        )

    # ---- inside

    def _correct_box_noise(self, graph: Graph, fit: _core.Fit) -> None:
        """Estimate the noise of boxes from those that the image border does not cut."""
        boxes, state = graph.core.boxes, self.state(graph)
        pose, objects = state.poses[boxes.pose], state.landmarks[boxes.object]
        projected, in_front = _core.project_to_boxes(
            graph.core.pose_model, graph.core.camera, pose, objects
        )
        chi2 = _core.box_chi_squares(
            graph.core.pose_model,
            graph.core.camera,
            pose,
            objects,
            boxes.box,
            boxes.covariance,
            boxes.truncated,
        )
        used = in_front & ~boxes.truncated.any(axis=1) & (chi2 <= GATE[4])
        side = np.tile(boxes.box[:, 2:] - boxes.box[:, :2], (1, 2))
        scale = edge_scales(self.recording.camera, boxes.box)
        better = corrected_boxes(
            self.box_noise,
            ((boxes.box - projected) / scale)[used].ravel(),
            (side / scale)[used].ravel(),
            fit.box_redundancy / max(int(np.sum(~boxes.truncated)), 1),
        )
        self.box_noise = within_limits(better)
        self.box_covariance = self.box_noise.covariance(
            self.recording.detections.box, self.recording.camera
        )

    def _believe_noise(self) -> None:
        if self.step_noise is None:
            return
        covariance = self.step_noise.covariance(self.levels, self.inflation)
        odometry = replace(self.recording.odometry, covariance=covariance)
        self.recording = replace(self.recording, odometry=odometry)

    def _path_by_odometry(self) -> Floats:
        """Return the poses so far as odometry alone has them, shape (n, d)."""
        odometry = self.recording.odometry
        steps = odometry.relative[: len(self.poses) - 1]
        return _core.dead_reckon(odometry.pose_model, odometry.first_pose, steps)

    def _graph_of(
        self, rows: Ints, numbers: Ints, *, end: int, path: Floats | None = None
    ) -> Graph:
        """Lay out some boxes as those of objects; odometry as measured, or that of a path."""
        odometry = self.recording.odometry
        relative = odometry.relative[: end - 1]
        if path is not None:
            relative = _core.between(odometry.pose_model, path[:-1], path[1:])
        part = replace(
            self.recording,
            timestamps=self.recording.timestamps[:end],
            odometry=replace(
                odometry, relative=relative, covariance=odometry.covariance[: end - 1]
            ),
            detections=replace(self.recording.detections.select(rows), object_id=numbers),
        )
        return build_graph(part, box_noise=self.box_noise, size_prior=self.size_prior)

    def _options(self, max_iterations: int = 1) -> _core.SolveOptions:
        """Few, quick steps from where the map stands, for outliers are many; none but to solve."""
        return _core.SolveOptions(
            mode=self.mode,
            residual=_core.Residual.BOX,
            loss=_core.Loss.CAUCHY,
            minimizer=_core.Minimizer.LEVENBERG_MARQUARDT,
            max_iterations=max_iterations,
            function_tolerance=1e-4,
        )
