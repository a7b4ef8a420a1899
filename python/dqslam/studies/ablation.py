"""The value of each part of the estimator: the paper's scenario with one part changed at a time.

Objects are ellipsoids and the sigmas are those of the simulated noise, so that the bound can be
reached.
"""

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dqslam import _core
from dqslam._core import LandmarkModel, Loss, Residual, Schedule, SolveOptions, Start, State
from dqslam.assumptions import BoxNoise
from dqslam.graph import Graph, build_graph
from dqslam.io.files import write_json
from dqslam.metrics import position_error
from dqslam.recording import Recording, Truth
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.simulator import simulate
from dqslam.studies.pool import run_each
from dqslam.uncertainty import posterior_bound, true_state

# A cost that exceeds that of a start at the truth by more than this, half a chi-square, is another
# minimum or none.
COST_TOLERANCE = 0.05
WRONG_SHARE = 0.2
WRONG_KINDS: "tuple[WrongKind, ...]" = ("random", "structured")
# The best decades for this scenario in a scan of 1e9 .. 1e11 px^4 m^2 and 1e7 .. 1e10 px^4.
ALGEBRAIC_SIGMAS = {Residual.ALGEBRAIC: 1e10, Residual.ALGEBRAIC_NORMALIZED: 1e8}

WrongKind = Literal["random", "structured"]
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Variant:
    """The default estimator with some parts changed, and the ids that it is given."""

    residual: Residual = Residual.TANGENT_THEN_BOX
    start: Start = Start.SPHERE
    schedule: Schedule = Schedule.GROW
    loss: Loss = Loss.NONE
    wrong_ids: WrongKind | None = None
    """The kind of wrong ids; None if all ids are right."""
    oracle: bool = False
    """Whether boxes with wrong ids are left out beforehand."""

    def options(self) -> SolveOptions:
        """Return the options of the solver.

        The raw algebraic residual uses free dual quadrics, as published.
        """
        options = SolveOptions(
            residual=self.residual, start=self.start, schedule=self.schedule, loss=self.loss
        )
        options.algebraic_sigma = ALGEBRAIC_SIGMAS.get(self.residual, options.algebraic_sigma)
        if self.residual == Residual.ALGEBRAIC:
            options.landmark_model = LandmarkModel.DUAL_QUADRIC
        return options


CLEAN_VARIANTS = tuple(Variant(*parts) for parts in product(Residual, Start, Schedule))
ROBUST_VARIANTS = tuple(
    Variant(loss=loss, wrong_ids=kind, oracle=oracle)
    for kind in WRONG_KINDS
    for loss, oracle in [(Loss.NONE, True), *((loss, False) for loss in Loss)]
)
VARIANTS = CLEAN_VARIANTS + ROBUST_VARIANTS


@dataclass(frozen=True)
class VariantSolve:
    """One solve of one trial."""

    reached: bool
    """Whether it ended at the cost that a start at the truth reaches.

    A solve may minimize another cost, because of its residual or of wrong ids. Then this is whether
    a polish with the right ids ends at that cost.
    """
    error_m: float
    """Mean distance of the poses from the truth; NaN if the solve failed."""
    bound_m: float
    """The posterior bound at the truth: the least expected error of any estimator."""
    iterations: int
    seconds: float
    failure: str = ""
    """The error if the solve failed."""


@dataclass(frozen=True, eq=False)
class AblationTrial:
    """The solves of one seed, by variant."""

    seed: int
    solves: dict[Variant, VariantSolve] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Problem:
    """The problem of one seed with one kind of data."""

    graph: Graph
    right_graph: Graph
    """The same problem without the boxes whose ids are wrong."""
    truth: Truth
    bound_m: float
    best_cost: float
    """Cost that the default estimator reaches from the truth, with the right ids."""

    def graph_of(self, variant: Variant) -> Graph:
        """Return the problem that a variant solves."""
        return self.right_graph if variant.oracle else self.graph

    def is_optimum(self, variant: Variant, solution: _core.Solution) -> bool:
        """Return whether a solution reaches the best cost.

        If the variant minimizes another cost, its solution is polished with the right ids first.
        """
        cost = solution.summary.final_cost
        same = variant.residual in (Residual.BOX, Residual.TANGENT_THEN_BOX) and (
            variant.oracle or variant.wrong_ids is None
        )
        if not same:
            rows = np.searchsorted(self.graph_of(variant).object_ids, self.right_graph.object_ids)
            local = SolveOptions(residual=Residual.BOX, schedule=Schedule.BATCH, loss=Loss.NONE)
            try:
                quadrics = solution.dual_quadrics[rows]
                ellipsoids = [_core.ellipsoid_from_dual_quadric(q) for q in quadrics]
                polished = _core.solve(
                    self.right_graph.core, local, State(solution.poses, ellipsoids)
                )
            except (RuntimeError, ValueError):
                return False
            cost = polished.summary.final_cost
        return cost < self.best_cost + COST_TOLERANCE


@dataclass(frozen=True)
class Row:
    """One variant over all trials."""

    variant: Variant
    optimum_rate: float
    """Share of the trials that reached the optimum."""
    error_over_bound: float
    """Mean error over mean bound, for the trials that did not fail."""
    median_error_over_bound: float
    iterations_med: float
    seconds_med: float
    failures: dict[int, str]
    """The reason why a trial failed, by its seed."""

    def as_dict(self) -> dict[str, Any]:
        """Return the row as plain data, with the parts of the variant by name."""
        parts = asdict(self.variant)
        for part in ("residual", "start", "schedule", "loss"):
            parts[part] = parts[part].name.lower()
        numbers = {name: value for name, value in asdict(self).items() if name != "variant"}
        return parts | numbers


@dataclass(frozen=True)
class AblationTable:
    """All variants."""

    trials: int
    seed: int
    rows: tuple[Row, ...]

    def save(self, path: str | Path) -> None:
        """Write the table as JSON; the file is complete or absent."""
        table = {
            "trials": self.trials,
            "seed": self.seed,
            "wrong_share": WRONG_SHARE,
            "algebraic_sigmas": {
                key.name.lower(): sigma for key, sigma in ALGEBRAIC_SIGMAS.items()
            },
            "rows": [row.as_dict() for row in self.rows],
        }
        write_json(path, table)


def run_ablation(
    scenario: Scenario,
    *,
    trials: int,
    seed: int,
    jobs: int = 1,
    variants: tuple[Variant, ...] | None = None,
    progress: Progress | None = None,
) -> AblationTable:
    """Run variants on the seeds seed, seed + 1 and so on.

    Parameters
    ----------
    jobs
        Number of processes; 1 runs everything in this process. Only times depend on it.
    variants
        The variants to run, by default all.
    progress
        Called with (trials done, trials) after each trial.
    """
    for name, value, least in (("trials", trials, 1), ("seed", seed, 0), ("jobs", jobs, 1)):
        if value < least:
            raise ValueError(f"{name}: expected {least} or more, got {value}")
    done: list[AblationTrial] = []
    run = partial(run_trial, scenario, variants=VARIANTS if variants is None else variants)
    with closing(run_each(run, range(seed, seed + trials), jobs=min(jobs, trials))) as running:
        for trial in running:
            done.append(trial)
            if progress is not None:
                progress(len(done), trials)
    return tabulate(sorted(done, key=lambda trial: trial.seed))


def tabulate(trials: list[AblationTrial]) -> AblationTable:
    """Summarize trials, given by ascending seed, by variant."""
    variants = tuple(trials[0].solves)
    return AblationTable(
        trials=len(trials),
        seed=trials[0].seed,
        rows=tuple(
            _row(variant, {trial.seed: trial.solves[variant] for trial in trials})
            for variant in variants
        ),
    )


def _row(variant: Variant, solves: dict[int, VariantSolve]) -> Row:
    solved = [one for one in solves.values() if not one.failure]
    errors, bounds = (
        np.array([getattr(one, name) for one in solved]) for name in ("error_m", "bound_m")
    )
    return Row(
        variant=variant,
        optimum_rate=float(np.mean([one.reached for one in solves.values()])),
        error_over_bound=float(errors.sum() / bounds.sum()) if solved else np.nan,
        median_error_over_bound=float(np.median(errors / bounds)) if solved else np.nan,
        iterations_med=float(np.median([one.iterations for one in solves.values()])),
        seconds_med=float(np.median([one.seconds for one in solves.values()])),
        failures={seed: one.failure for seed, one in solves.items() if one.failure},
    )


def run_trial(scenario: Scenario, seed: int, *, variants: tuple[Variant, ...]) -> AblationTrial:
    """Simulate one seed, with right and with wrong ids, and solve with every variant."""
    scenario = scenario.model_copy(update={"objects": "ellipsoids"})
    clean, truth = simulate(scenario, seed=seed)
    trial = AblationTrial(seed)
    for kind in dict.fromkeys(variant.wrong_ids for variant in variants):
        problem = _problem(scenario, seed, kind, clean, truth)
        for variant in variants:
            if variant.wrong_ids == kind:
                trial.solves[variant] = _solve_variant(problem, variant)
    return trial


def _problem(
    scenario: Scenario, seed: int, kind: WrongKind | None, clean: Recording, truth: Truth
) -> _Problem:
    recording, right = clean, np.ones(len(clean.detections), dtype=np.bool_)
    if kind is not None:
        wrong = {"wrong_associations": WRONG_SHARE, "wrong_association_kind": kind}
        detector = scenario.detector.model_copy(update=wrong)
        recording, _ = simulate(scenario.model_copy(update={"detector": detector}), seed=seed)
        right = recording.detections.object_id == clean.detections.object_id
    right_graph = _graph(replace(recording, detections=recording.detections.select(right)))
    options = SolveOptions(loss=Loss.NONE)
    best = _core.solve(right_graph.core, options, true_state(right_graph, truth, options))
    return _Problem(
        graph=_graph(recording),
        right_graph=right_graph,
        truth=truth,
        bound_m=posterior_bound(right_graph, truth).position_error,
        best_cost=best.summary.final_cost,
    )


def _graph(recording: Recording) -> Graph:
    return build_graph(replace(recording, positions=None), box_noise=BoxNoise(1.0, 0.0))


def _solve_variant(problem: _Problem, variant: Variant) -> VariantSolve:
    graph = problem.graph_of(variant)
    start = time.perf_counter()
    try:
        solution = _core.solve(graph.core, variant.options())
    except (RuntimeError, ValueError) as error:
        seconds = time.perf_counter() - start
        failure = f"{type(error).__name__}: {error}"
        return VariantSolve(False, np.nan, problem.bound_m, 0, seconds, failure)
    seconds = time.perf_counter() - start
    return VariantSolve(
        reached=problem.is_optimum(variant, solution),
        error_m=position_error(problem.truth.pose_model, solution.poses, problem.truth.poses),
        bound_m=problem.bound_m,
        iterations=solution.summary.iterations,
        seconds=seconds,
    )
