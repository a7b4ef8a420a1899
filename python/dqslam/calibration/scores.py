"""Scores of the parameters of a calibration at an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import SolveOptions
from dqslam.calibration.parameters import LARGEST, calibration_parameters, parameter_units
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.subgraph import only_objects

# A parameter whose information is a smaller share of what it would be with all poses and objects
# known is not determined.
LEAST_INFORMATION = 1e-6


def mapped_graph(graph: Graph, estimate: Estimate) -> Graph:
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
class Scores:
    """Scores of p parameters, and their covariance with the noise as the residuals show it."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    score: Floats  # (p,)
    information: Floats  # (p, p)
    covariance: Floats  # of the scores, (p, p)
    unchecked: Floats  # (p,)

    @classmethod
    def at(cls, graph: Graph, state: _core.State, options: SolveOptions) -> Scores:
        """Linearize at an estimate."""
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
            units=parameter_units(),
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

    def determined(self, rows: Sequence[int], beside: Sequence[int] = ()) -> list[int]:
        """Return the rows that the data determine together, while others are open as well.

        A parameter that would be known less well than the largest value that makes sense is not
        determined, either. Of parameters that cannot be told apart, the first remain.
        """
        kept = list(rows)
        while kept:
            together = [*kept, *beside]
            sigma = np.sqrt(np.diag(self.estimate(together)[1]))
            open_rows = [
                row
                for row, one in zip(kept, sigma[: len(kept)], strict=True)
                if not (self.is_determined(row, together) and one < LARGEST[self.units[row]])
            ]
            if not open_rows:
                return kept
            kept.remove(open_rows[-1])
        return kept
