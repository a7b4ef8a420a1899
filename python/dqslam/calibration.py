"""Whether the boxes contradict what an estimate takes for known: camera, mount and odometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, require
from dqslam._core import SolveOptions
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.subgraph import only_objects

# Fourteen parameters are tested at once: a false alarm has a probability of 1e-3.
SURE_SIGMAS = 4.0
# Parameters that explain the residuals nearly as well as the best one, as a share of its sigmas.
RIVAL_SHARE = 0.9
# The tests are linear: where a larger value explains the residuals best, something else is wrong
# with the boxes. By unit; a share has none.
LARGEST = {"rad": 0.2, "m": 1.0, "px": 100.0, "": 0.2, "rad/s": 0.1, "s": 1.0}
# A parameter whose information is a smaller share of what it would be with all poses and objects
# known is not determined.
LEAST_INFORMATION = 1e-6
# A calibration has converged when no parameter moves by more than this share of its sigma.
SMALL_CHANGE = 0.05
MAX_ROUNDS = 10

_DESCRIPTIONS = {
    "mount_pitch": "the camera is pitched by {}",
    "mount_yaw": "the camera is turned sideways by {}",
    "mount_roll": "the camera is rolled by {}",
    "mount_forward": "the camera is {} further forward",
    "mount_left": "the camera is {} further left",
    "mount_up": "the camera is {} higher",
    "focal_length": "the focal length is larger by {}",
    "principal_u": "the principal point is {} further right",
    "principal_v": "the principal point is {} further down",
    "distortion": "the lens has a distortion k1 of {}",
    "odometry_scale": "the steps of the odometry are longer by {}",
    "gyro_bias": "the odometry turns too little to the left, by {}",
    "time_offset": "the images are later than their time stamps by {}",
    "object_size": "objects are larger than their prior size by {}",
}


@dataclass(frozen=True)
class CalibrationFinding:
    """A deviation from the calibration that the boxes are sure of."""

    name: str
    """Name of the parameter, one of `calibration_parameters`."""
    value: float
    """How far the true value is from the one in use, in ``unit``."""
    sigma: float
    """Standard deviation of ``value``."""
    unit: str
    """Unit of both; empty for a share of the value in use."""
    rivals: tuple[str, ...] = ()
    """Other parameters that would explain the boxes nearly as well."""

    @property
    def sigmas(self) -> float:
        """How many standard deviations the value is from zero."""
        return abs(self.value) / self.sigma

    def __str__(self) -> str:
        """Say it in a sentence, with degrees and percent."""
        scale, unit = {"rad": (180.0 / np.pi, " deg"), "rad/s": (180.0 / np.pi, " deg/s")}.get(
            self.unit, (100.0, " %") if not self.unit else (1.0, f" {self.unit}")
        )
        if self.name == "distortion":
            scale, unit = 1.0, ""
        value = f"{scale * self.value:.3g} ± {scale * self.sigma:.2g}{unit}"
        rest = f" (or {' or '.join(self.rivals)})" if self.rivals else ""
        return f"the boxes say that {_DESCRIPTIONS[self.name].format(value)}{rest}"


def calibration_parameters() -> tuple[str, ...]:
    """Return the names of all parameters that are tested and can be estimated."""
    return tuple(parameter.name for parameter in _core.calibration_parameters())


def check_calibration(
    graph: Graph,
    estimate: Estimate,
    options: SolveOptions | None = None,
    *,
    sizes_known: bool = False,
) -> tuple[CalibrationFinding, ...]:
    """Test whether the boxes contradict camera, mount or odometry, by score tests.

    The most significant deviation comes first. Each later one is what the residuals show once the
    earlier ones are allowed for. The noise of odometry and of boxes is scaled to their residuals,
    so that a wrong level of noise is no finding. No poses or objects are estimated again.

    The errors of boxes are taken to be independent. Detectors repeat theirs from image to image,
    and objects are no ellipsoids: on recordings, take a finding of less than ten sigmas for a hint.

    Parameters
    ----------
    graph, estimate, options
        The problem, its estimate, and the options of the solve. Objects that are not in the
        estimate take no part.
    sizes_known
        Whether the prior sizes of objects are right on average. If not, a factor common to all of
        them is left open, and the scale of the odometry cannot be told from it.

    Raises
    ------
    ValueError
        When the landmarks are free quadrics, or a box next to the estimate's is no box.
    RuntimeError
        When the box of an object is undefined at the estimate, or next to it.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph)
    >>> dq.check_calibration(graph, estimate)
    ()
    """
    require(graph, Graph, "check_calibration", "call build_graph(recording) first")
    require(estimate, Estimate, "check_calibration", "estimate, summary = solve(graph)")
    scores = _Scores.at(_mapped(graph, estimate), estimate, options or SolveOptions())
    allowed = [] if sizes_known else [scores.names.index("object_size")]
    nuisance = len(allowed)
    rivals: list[tuple[str, ...]] = []
    while len(allowed) < len(scores.names):
        sigmas = scores.sigmas_beside(allowed)
        best = int(np.argmax(sigmas))
        if not sigmas[best] > SURE_SIGMAS:
            break
        near = np.flatnonzero(sigmas >= RIVAL_SHARE * sigmas[best])
        rivals.append(tuple(scores.names[row] for row in near if row != best))
        allowed.append(best)
    if len(allowed) == nuisance:
        return ()
    values, covariance = scores.estimate(allowed)
    return tuple(
        CalibrationFinding(
            scores.names[row],
            float(values[i]),
            float(np.sqrt(covariance[i, i])),
            scores.units[row],
            rivals[i - nuisance],
        )
        for i, row in enumerate(allowed)
        if i >= nuisance
    )


def solve_with_calibration(
    graph: Graph,
    parameters: Sequence[str],
    options: SolveOptions | None = None,
) -> tuple[Graph, Estimate, _core.Summary, tuple[CalibrationFinding, ...]]:
    """Estimate some parameters of the calibration with all poses and objects.

    The solve alternates with Gauss-Newton steps of the parameters, which are the score tests of
    `check_calibration`.

    Parameters
    ----------
    parameters
        Names from `calibration_parameters`.

    Returns
    -------
    graph
        The problem with the calibration as estimated, and with the objects of the estimate.
    estimate, summary
        Of the last solve, as `solve` returns them.
    findings
        Value and standard deviation of each parameter, in their order, whether significant or not.

    Raises
    ------
    ValueError
        For an unknown name, for a parameter that the data do not determine, or if the calibration
        does not converge.

    Examples
    --------
    A camera that is turned by two degrees, which nobody has told the estimator:

    >>> import dqslam as dq
    >>> import numpy as np
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> calibrated, estimate, summary, (yaw,) = dq.solve_with_calibration(graph, ["mount_yaw"])
    >>> bool(abs(np.degrees(yaw.value)) < 0.5)
    True
    """
    require(graph, Graph, "solve_with_calibration", "call build_graph(recording) first")
    options = options or SolveOptions()
    names = calibration_parameters()
    for name in parameters:
        if name not in names:
            raise ValueError(f"calibration: no parameter {name!r}, only: {', '.join(names)}")
    rows = [names.index(name) for name in parameters]
    total = np.zeros(len(names))
    graph = _mapped(graph, solve(graph, options)[0])
    calibrated = graph
    for _ in range(MAX_ROUNDS):
        estimate, summary = solve(calibrated, options)
        calibrated = _mapped(calibrated, estimate)
        scores = _Scores.at(calibrated, estimate, options)
        open_rows = [row for row in rows if not scores.is_determined(row, rows)]
        if open_rows:
            raise ValueError(f"calibration: the data do not determine {scores.names[open_rows[0]]}")
        change, covariance = scores.estimate(rows)
        sigma = np.sqrt(np.diag(covariance))
        total[rows] += change
        state = _core.State(estimate.poses, estimate.ellipsoids)
        graph = _mapped(graph, estimate)
        core = _core.recalibrate(graph.core, state, graph.timestamps, total)
        calibrated = replace(graph, core=core)
        if (np.abs(change) <= SMALL_CHANGE * sigma).all():
            findings = tuple(
                CalibrationFinding(name, float(total[row]), float(one), scores.units[row])
                for name, row, one in zip(parameters, rows, sigma, strict=True)
            )
            return calibrated, estimate, summary, findings
    raise ValueError(f"calibration: not converged after {MAX_ROUNDS} rounds")


def _mapped(graph: Graph, estimate: Estimate) -> Graph:
    """Return the problem with the objects of an estimate only."""
    kept = np.isin(graph.object_ids, estimate.object_ids)
    if kept.all():
        return graph
    return replace(
        graph,
        core=only_objects(graph.core, kept),
        object_ids=graph.object_ids[kept],
        class_names=tuple(np.array(graph.class_names)[kept].tolist()),
        observations=graph.observations[kept],
    )


@dataclass(frozen=True, eq=False)
class _Scores:
    """Scores of p parameters, and their covariance with the noise as the residuals show it."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    score: Floats  # (p,)
    information: Floats  # (p, p)
    covariance: Floats  # of the scores, (p, p)
    unchecked: Floats  # (p,)

    @classmethod
    def at(cls, graph: Graph, estimate: Estimate, options: SolveOptions) -> _Scores:
        """Linearize at an estimate."""
        state = _core.State(estimate.poses, estimate.ellipsoids)
        found = _core.score_calibration(graph.core, options, state, graph.timestamps)
        fit = _core.fit(graph.core, options, state)
        of_odometry, of_boxes = found.from_odometry, found.from_boxes
        redundancy = float(np.sum(1.0 - fit.odometry_leverage))
        squares = float(np.sum(fit.odometry_residuals**2))
        odometry_level = squares / redundancy if redundancy > 1.0 else 1.0
        box_level = fit.box_squares / fit.box_redundancy if fit.box_redundancy > 1.0 else 1.0
        of_priors = found.information - of_odometry - of_boxes
        return cls(
            names=calibration_parameters(),
            units=tuple(parameter.unit for parameter in _core.calibration_parameters()),
            score=found.score,
            information=found.information,
            covariance=odometry_level * of_odometry + box_level * of_boxes + of_priors,
            unchecked=found.unchecked,
        )

    def beside(self, row: int, allowed: Sequence[int]) -> Floats:
        """Return the combination of scores, (p,), that is one's with others estimated too."""
        weights = np.zeros(len(self.score))
        weights[row] = 1.0
        if len(allowed):
            block = self.information[np.ix_(allowed, allowed)]
            across = self.information[row, allowed]
            weights[list(allowed)] = -np.linalg.lstsq(block, across, rcond=None)[0]
        return weights

    def is_determined(self, row: int, others: Sequence[int]) -> bool:
        """Return whether the data determine a parameter while others are estimated too."""
        weights = self.beside(row, [other for other in others if other != row])
        left = float(weights @ self.information @ weights)
        return left > LEAST_INFORMATION * float(self.unchecked[row])

    def sigmas_beside(self, allowed: Sequence[int]) -> Floats:
        """Return how significant each parameter is with some allowed for, (p,).

        It is 0 for those that are allowed for, not determined, or so large that the test fails.
        """
        sigmas = np.zeros(len(self.score))
        for row in range(len(self.score)):
            if row in allowed or not self.is_determined(row, allowed):
                continue
            weights = self.beside(row, allowed)
            score = abs(float(weights @ self.score))
            if score > LARGEST[self.units[row]] * float(weights @ self.information @ weights):
                continue
            sigmas[row] = score / np.sqrt(float(weights @ self.covariance @ weights))
        return sigmas

    def estimate(self, rows: Sequence[int]) -> tuple[Floats, Floats]:
        """Return the values of some parameters, estimated together, and their covariance."""
        block = np.ix_(rows, rows)
        inverse = np.linalg.pinv(self.information[block])
        return inverse @ self.score[list(rows)], inverse @ self.covariance[block] @ inverse
