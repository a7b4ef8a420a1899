"""Run the paper's experiment."""

from collections.abc import Callable
from contextlib import closing
from functools import partial

from dqslam.estimate import Estimate
from dqslam.graph import solve
from dqslam.metrics import evaluate
from dqslam.recording import Truth
from dqslam.simulation.scenario import Scenario
from dqslam.simulation.simulator import simulate
from dqslam.studies.paper.methods import (
    LossName,
    Method,
    Settings,
    ShapeName,
    assumptions_of,
    default_loss,
    method_options,
    seen_by,
)
from dqslam.studies.paper.table import PaperTable, tabulate
from dqslam.studies.paper.trial import PaperTrial, run_trial
from dqslam.studies.pool import Backend, run_each

Progress = Callable[[int, int], None]


def run_paper(
    scenario: Scenario,
    *,
    trials: int,
    seed: int,
    method: Method,
    loss: LossName | None = None,
    bound: bool = False,
    shape: ShapeName = "ellipsoid",
    jobs: int | None = 1,
    backend: Backend | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> PaperTable:
    """Run trials with the seeds seed, seed + 1 and so on, and tabulate their errors.

    Parameters
    ----------
    loss
        The robust loss on boxes; by default "none", or "gnc_gm" if some ids are wrong.
    bound
        Whether to compare with the posterior bound and the optimum, which needs more solves.
        For objects in their own shape, the estimator then uses the true noise of the boxes and
        the true spread of the sizes.
    shape
        The shape of the objects in the estimate.
    jobs, backend, scheduler
        Where trials run, as in `pool.run_each`. Only times depend on it.
    progress
        Called with (trials done, trials) after each trial.
    """
    for name, value, least in (("trials", trials, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name}: expected {least} or more, got {value}")
    settings = Settings(method, loss or default_loss(scenario, method), bound, shape)
    run = partial(_run_seed, scenario=scenario, settings=settings)
    done: list[PaperTrial] = []
    seeds = range(seed, seed + trials)
    with closing(run_each(run, seeds, jobs=jobs, backend=backend, scheduler=scheduler)) as running:
        for trial in running:
            done.append(trial)
            if progress is not None:
                progress(len(done), trials)
    return tabulate(sorted(done, key=lambda trial: trial.seed), scenario, settings)


def _run_seed(seed: int, scenario: Scenario, settings: Settings) -> PaperTrial:
    return run_trial(scenario, seed, settings)


def example_maps(table: PaperTable, count: int) -> list[tuple[str, Estimate, Truth]]:
    """Solve the first successful monocular trials again: title, estimate and truth of each."""
    row = table.best("monocular")
    options = method_options(table.settings, row.algebraic_sigma)
    assumptions = assumptions_of(table.scenario, table.settings)
    maps = []
    for seed in [seed for seed in table.seeds if seed not in row.failures][:count]:
        recording, truth = simulate(table.scenario, seed=seed)
        estimate, _ = solve(assumptions.graph(seen_by("monocular", recording)), options)
        report = evaluate(estimate, truth)
        errors = f"odometry {report.odometry_rmse_pos:.2f} m, estimate {report.rmse_pos:.2f} m"
        maps.append((f"seed {seed}: {errors}", estimate, truth))
    return maps
