"""Run the worlds."""

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial

from dqslam.simulation.scenario import Scenario
from dqslam.studies.pool import Backend, run_each
from dqslam.studies.worlds.rows import RowName, possible_rows, usual_rows
from dqslam.studies.worlds.summary import WorldsSummary, summarize
from dqslam.studies.worlds.trial import WorldTrial, run_trial

Progress = Callable[[int, int], None]


def run_worlds(
    scenarios: Sequence[Scenario],
    *,
    trials: int,
    seed: int,
    rows: tuple[RowName, ...] | None = None,
    jobs: int | None = 1,
    backend: Backend | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> WorldsSummary:
    """Run trials with seeds seed, seed + 1, ... in each world.

    Parameters
    ----------
    scenarios
        The worlds; their names must differ.
    rows
        What is run in each world where it is possible; by default `usual_rows`.
    jobs, backend, scheduler
        Where trials run, as in `pool.run_each`. Only times depend on it.
    progress
        Called with (trials done, trials) after each.
    """
    for name, value, least in (("trials", trials, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name}: expected {least} or more, got {value}")
    by_name = {scenario.name: scenario for scenario in scenarios}
    if not scenarios or len(by_name) < len(scenarios):
        raise ValueError("scenarios: expected one or more, of different names")
    chosen = {name: _rows(scenario, rows) for name, scenario in by_name.items()}
    seeds = range(seed, seed + trials)
    items = [(scenario.name, one) for scenario in scenarios for one in seeds]
    run = partial(_run_item, scenarios=by_name, rows=chosen)
    done: list[WorldTrial] = []
    with closing(run_each(run, items, jobs=jobs, backend=backend, scheduler=scheduler)) as running:
        for trial in running:
            done.append(trial)
            if progress is not None:
                progress(len(done), len(items))
    return summarize(scenarios, seeds, done)


def _rows(scenario: Scenario, asked: tuple[RowName, ...] | None) -> tuple[RowName, ...]:
    if asked is None:
        return usual_rows(scenario)
    rows = tuple(row for row in possible_rows(scenario) if row in asked)
    if not rows:
        raise ValueError(
            f"rows: {scenario.name} has nothing for {' or '.join(asked)}: no right sigmas that "
            "could be told, or no wrong calibration"
        )
    return rows


def _run_item(
    item: tuple[str, int],
    scenarios: dict[str, Scenario],
    rows: dict[str, tuple[RowName, ...]],
) -> WorldTrial:
    name, seed = item
    return run_trial(scenarios[name], seed, rows[name])
