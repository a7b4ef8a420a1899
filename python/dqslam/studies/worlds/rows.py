"""What is run in each world: the solver with true or default assumptions, or the whole pipeline."""

from typing import Literal, get_args

from dqslam._core import Loss, SolveOptions
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import Beliefs, true_beliefs

RowName = Literal["told", "default", "robust", "run"]
"""The ids are those of the recording in each of them.

told
    `solve` with its default options; it is told the error of the boxes and the spread of the sizes.
default
    `solve` with all defaults.
robust
    `solve` with the loss GNC_GM, the other options and the assumptions by default.
run
    The pipeline, `run`, with all defaults.
"""

ROWS: tuple[RowName, ...] = get_args(RowName)


def usual_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return the rows that make sense in a world, but for the pipeline."""
    rows: list[RowName] = ["told"] if has_true_beliefs(scenario) else []
    rows.append("default")
    if scenario.detector.shows_wrong_objects:
        rows.append("robust")
    return tuple(rows)


def has_true_beliefs(scenario: Scenario) -> bool:
    """Return whether there are right sigmas: the boxes of cuboids are not those of ellipsoids."""
    return scenario.objects == "ellipsoids"


def row_beliefs(row: RowName, scenario: Scenario) -> Beliefs:
    """Return the assumptions about boxes and objects."""
    return true_beliefs(scenario) if row == "told" else Beliefs()


def row_options(row: RowName) -> SolveOptions:
    """Return the options of the solver."""
    return SolveOptions(loss=Loss.GNC_GM) if row == "robust" else SolveOptions()
