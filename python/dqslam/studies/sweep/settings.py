"""The settings of a trial of a sweep, as in a file: a scenario and an estimator."""

from dataclasses import asdict
from enum import Enum
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from dqslam._core import SolveOptions
from dqslam.assumptions import BoxNoise, SizePrior
from dqslam.simulation.scenario import Scenario
from dqslam.studies.paper import (
    Assumptions,
    LossName,
    Method,
    RowName,
    Settings,
    ShapeName,
    assumptions_of,
    default_loss,
    method_options,
)


class _Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class BoxNoiseSettings(_Settings):
    """The settings of `BoxNoise` in a file, with the same defaults."""

    pixels: Annotated[float, Field(gt=0.0)] = BoxNoise.pixels
    relative: Annotated[float, Field(ge=0.0)] = BoxNoise.relative


class SizePriorSettings(_Settings):
    """A size prior, with the keys of a table of size priors."""

    median_m: Annotated[float, Field(gt=0.0)]
    """Median semi-axis, meters."""
    spread: Annotated[float, Field(gt=1.0)]
    """Two of three semi-axes are between median / spread and median * spread."""


class _Estimator(_Settings):
    method: Method = "dqslam"
    input: RowName = "monocular"
    """Whether the estimator gets boxes alone, or also measured positions of the objects."""
    box_noise: BoxNoiseSettings | None = None
    size_prior: SizePriorSettings | None = None
    shape: ShapeName = "ellipsoid"
    """The shape of the objects in the estimate."""


def _solver_settings() -> dict[str, Any]:
    """Return a field for each option of the solver; None means the default of solver or method."""
    defaults = SolveOptions()
    fields: dict[str, Any] = {}
    for name in [name for name in dir(defaults) if not name.startswith("_")]:
        value = getattr(defaults, name)
        is_choice = isinstance(value, Enum)
        words = tuple(choice.name.lower() for choice in type(value)) if is_choice else ()
        fields[name] = ((Literal[words] if is_choice else type(value)) | None, None)
    return fields


# The core owns its options, so their names and types come from there.
Estimator = create_model(
    "Estimator", __base__=_Estimator, __module__=__name__, **_solver_settings()
)


class TrialSettings(_Settings):
    """Everything that a trial depends on, except its seed."""

    scenario: Scenario
    estimator: Estimator = Estimator()
    bound: bool = False
    """Whether to compare with the posterior bound and the optimum, see `dqslam paper --bound`."""

    @model_validator(mode="after")
    def _method_has_what_it_needs(self) -> Self:
        Settings(self.estimator.method, self._loss, self.bound, self.estimator.shape)
        if self.estimator.method == "paper" and self._solver("algebraic_sigma") is None:
            raise ValueError(
                "estimator.algebraic_sigma is missing: the method of the paper has no default; "
                "the best decade of its own scenario is 1e10"
            )
        return self

    @property
    def _loss(self) -> LossName:
        chosen: LossName | None = self._solver("loss")
        return chosen or default_loss(self.scenario, self.estimator.method)

    def _solver(self, name: str) -> Any:
        return getattr(self.estimator, name)

    @property
    def input(self) -> RowName:
        """Return which measurements the estimator is given."""
        return self.estimator.input

    def options(self, *, loss: LossName | None = None) -> SolveOptions:
        """Return the options of the solver; a given loss replaces the chosen one."""
        chosen = Settings(self.estimator.method, loss or self._loss)
        options = method_options(chosen, self._solver("algebraic_sigma"))
        for name in [name for name in _SOLVER_NAMES if name != "loss"]:
            value = self._solver(name)
            if value is not None:
                kind = type(getattr(options, name))
                setattr(options, name, kind[value.upper()] if issubclass(kind, Enum) else value)
        return options

    def assumptions(self) -> Assumptions:
        """Return the assumptions about boxes and objects."""
        chosen = Settings(self.estimator.method, bound=self.bound, shape=self.estimator.shape)
        default = assumptions_of(self.scenario, chosen)
        noise, prior = self.estimator.box_noise, self.estimator.size_prior
        return Assumptions(
            default.box_noise if noise is None else BoxNoise(noise.pixels, noise.relative),
            default.size_prior
            if prior is None
            else SizePrior(float(np.log(prior.median_m)), float(np.log(prior.spread))),
            default.shape,
        )

    def in_full(self) -> dict[str, Any]:
        """Return every setting that the result of a trial depends on, including defaults."""
        options = self.options()
        return {
            "scenario": self.scenario.model_dump(mode="json", exclude={"name", "title"}),
            "estimator": {
                "method": self.estimator.method,
                "input": self.estimator.input,
                **asdict(self.assumptions()),
                **{name: _plain(getattr(options, name)) for name in _SOLVER_NAMES},
            },
            "bound": self.bound,
        }


_SOLVER_NAMES = tuple(_solver_settings())


def _plain(value: Any) -> Any:
    return value.name.lower() if isinstance(value, Enum) else value
