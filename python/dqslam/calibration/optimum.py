"""The optimum of a problem next to a state."""

from __future__ import annotations

from dqslam import _core
from dqslam._core import Loss, Residual, Schedule, SolveOptions
from dqslam.subgraph import rebuilt

# How the optimum follows a small change must not drown in what is left of its search.
FUNCTION_TOLERANCE = 1e-13


def settle(
    core: _core.Graph, state: _core.State, options: SolveOptions
) -> tuple[_core.State, float]:
    """Return the optimum next to a state, by all boxes of a problem, and its cost."""
    precise = SolveOptions(
        residual=Residual.BOX
        if options.residual == Residual.TANGENT_THEN_BOX
        else options.residual,
        algebraic_sigma=options.algebraic_sigma,
        mode=options.mode,
        loss=Loss.NONE,
        schedule=Schedule.BATCH,
        function_tolerance=FUNCTION_TOLERANCE,
        max_iterations=options.max_iterations,
    )
    found = _core.solve(core, precise, state)
    return _core.State(found.poses, found.landmarks), float(found.summary.final_cost)


def fitting(core: _core.Graph, state: _core.State, options: SolveOptions) -> _core.Graph:
    """Return a problem without the boxes that do not fit a state, if the loss is robust."""
    if options.loss == Loss.NONE:
        return core
    table = core.boxes
    chi2 = _core.box_chi_squares(
        core.pose_model,
        core.camera,
        state.poses[table.pose],
        state.landmarks[table.object],
        table.box,
        table.covariance,
        table.truncated,
    )
    fits = chi2 <= options.outlier_chi_square
    boxes = _core.BoxTable(
        pose=table.pose[fits],
        object=table.object[fits],
        box=table.box[fits],
        covariance=table.covariance[fits],
        truncated=table.truncated[fits],
    )
    return rebuilt(core, boxes=boxes)
