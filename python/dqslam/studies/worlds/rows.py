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


def possible_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return all rows but "told" where there are no right sigmas.

    The boxes of cubes and cuboids differ from those of ellipsoids, and not at random.
    """
    return ROWS if scenario.objects == "ellipsoids" else ROWS[1:]


def usual_rows(scenario: Scenario) -> tuple[RowName, ...]:
    """Return the possible rows but the pipeline, and "robust" where boxes show something else."""
    left_out = {"run"} if scenario.detector.shows_wrong_objects else {"run", "robust"}
    return tuple(row for row in possible_rows(scenario) if row not in left_out)


def row_beliefs(row: RowName, scenario: Scenario) -> Beliefs:
    """Return the assumptions about boxes and objects."""
    return true_beliefs(scenario) if row == "told" else Beliefs()


def row_options(row: RowName) -> SolveOptions:
    """Return the options of the solver."""
    return SolveOptions(loss=Loss.GNC_GM) if row == "robust" else SolveOptions()
