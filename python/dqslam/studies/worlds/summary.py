"""The trials of each world in numbers."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dqslam._version import version
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import Statistics
from dqslam.studies.worlds.rows import RowName
from dqslam.studies.worlds.trial import WorldSolve, WorldTrial


@dataclass(frozen=True)
class RowSummary:
    """All trials of one row in one world. Statistics are over the trials that have the number."""

    trials: int
    failures: dict[int, str]
    """Why there is no estimate, by seed."""
    score_failures: dict[int, str]
    """Why an estimate was not compared with bound and optimum, by seed."""
    compared: int
    """Trials that were compared with the optimum."""
    at_optimum: int
    lost: tuple[int, ...]
    """Seeds that end far above the optimum."""
    lost_converged: tuple[int, ...]
    """Those of them of which the solver says that it converged."""
    optimum_not_converged: tuple[int, ...]
    """Seeds at the optimum of which the solver says that it did not converge."""
    worse_than_odometry: tuple[int, ...]
    """Seeds."""
    positions: Statistics
    """Meters."""
    centers: Statistics
    """Meters."""
    error_over_bound: float
    """Mean position error over the mean of the bound."""
    pose_nees: Statistics
    center_nees: Statistics
    mapped: float
    """Mean number of objects in the map."""
    cpu_seconds: float
    """Median processor time of a trial."""

    def as_dict(self) -> dict[str, Any]:
        """Return all but the time, as plain data."""
        content = asdict(self)
        del content["cpu_seconds"]
        return content


@dataclass(frozen=True)
class WorldSummary:
    """One world."""

    scenario: Scenario
    odometry: Statistics
    """Position error of odometry alone, meters."""
    rows: dict[RowName, RowSummary]


@dataclass(frozen=True)
class WorldsSummary:
    """All worlds that were run, in the order asked for."""

    seeds: tuple[int, ...]
    worlds: tuple[WorldSummary, ...]
    trials: tuple[WorldTrial, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as plain data for JSON; only `cpu_seconds` differs from run to run."""
        return {
            "dqslam_version": version(),
            "seed": self.seeds[0],
            "trials": len(self.seeds),
            "worlds": {
                world.scenario.name: {
                    "title": world.scenario.title,
                    "odometry": asdict(world.odometry),
                    **{name: row.as_dict() for name, row in world.rows.items()},
                }
                for world in self.worlds
            },
            "cpu_seconds": {
                world.scenario.name: {name: row.cpu_seconds for name, row in world.rows.items()}
                for world in self.worlds
            },
        }


def summarize(
    scenarios: Sequence[Scenario], seeds: Sequence[int], trials: Sequence[WorldTrial]
) -> WorldsSummary:
    """Summarize trials world by world; their order does not matter."""
    ordered = []
    worlds = []
    for scenario in scenarios:
        own = sorted(
            (trial for trial in trials if trial.world == scenario.name),
            key=lambda trial: trial.seed,
        )
        ordered += own
        rows = {name: _row({trial.seed: trial for trial in own}, name) for name in own[0].rows}
        odometry = Statistics.of([trial.odometry_error for trial in own])
        worlds.append(WorldSummary(scenario, odometry, rows))
    return WorldsSummary(tuple(seeds), tuple(worlds), tuple(ordered))


def _row(trials: dict[int, WorldTrial], name: RowName) -> RowSummary:
    solves = {seed: trial.rows[name] for seed, trial in trials.items()}
    estimates = {seed: one for seed, one in solves.items() if not one.failure}

    def seeds(test: Callable[[WorldSolve], bool | None]) -> tuple[int, ...]:
        return tuple(seed for seed, one in estimates.items() if test(one))

    bounded = [one for one in estimates.values() if np.isfinite(one.bound)]
    return RowSummary(
        trials=len(solves),
        failures={seed: one.failure for seed, one in solves.items() if one.failure},
        score_failures={
            seed: one.score_failure for seed, one in estimates.items() if one.score_failure
        },
        compared=len(seeds(lambda one: one.is_optimum is not None)),
        at_optimum=len(seeds(lambda one: one.is_optimum)),
        lost=seeds(lambda one: one.is_lost),
        lost_converged=seeds(lambda one: one.is_lost and one.converged),
        optimum_not_converged=seeds(lambda one: one.is_optimum and not one.converged),
        worse_than_odometry=tuple(
            seed
            for seed, one in estimates.items()
            if one.position_error > trials[seed].odometry_error
        ),
        positions=_finite([one.position_error for one in estimates.values()]),
        centers=_finite([one.center_error for one in estimates.values()]),
        error_over_bound=float(
            np.mean([one.position_error for one in bounded])
            / np.mean([one.bound for one in bounded])
        )
        if bounded
        else float("nan"),
        pose_nees=_finite([one.pose_nees for one in estimates.values()]),
        center_nees=_finite([one.center_nees for one in estimates.values()]),
        mapped=float(np.mean([one.mapped for one in estimates.values()])) if estimates else 0.0,
        cpu_seconds=float(np.median([one.cpu_seconds for one in solves.values()])),
    )


def _finite(values: Sequence[float]) -> Statistics:
    return Statistics.of([value for value in values if np.isfinite(value)])
