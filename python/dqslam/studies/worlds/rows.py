"""What is run in each world: the solver with true or default assumptions, or the whole pipeline."""

from typing import Literal, get_args

from dqslam._core import Loss, SolveOptions
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import Assumptions, true_assumptions

RowName = Literal["told", "default", "plain", "run"]
"""The ids are those of the recording in each of them.

told
    `solve` with its default options; it is told the error of the boxes and the spread of the sizes.
default
    `solve` with all defaults.
plain
    `solve` without a robust loss, the other options and the assumptions by default.
run
    The pipeline, `run`, with all defaults.
"""

ROWS: tuple[RowName, ...] = get_args(RowName)


def possible_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return all rows but "told" where there are no right sigmas.

    The boxes of cubes and cuboids differ from those of ellipsoids, and not at random.
    """
    return ROWS if scenario.objects == "ellipsoids" else ROWS[1:]


def usual_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return "told" where it is possible, and "default"."""
    return tuple(row for row in possible_rows(scenario) if row in ("told", "default"))


def row_assumptions(row: RowName, scenario: Scenario) -> Assumptions:
    """Return the assumptions about boxes and objects."""
    return true_assumptions(scenario) if row == "told" else Assumptions()


def row_options(row: RowName) -> SolveOptions:
    """Return the options of the solver."""
    return SolveOptions(loss=Loss.NONE) if row == "plain" else SolveOptions()
