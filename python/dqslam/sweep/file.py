"""The file of a sweep: which settings are varied, and the cells that come of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from dqslam._files import FileError, FileErrors
from dqslam.config import TomlFile, check_model, read_toml, right_keys, unknown_keys
from dqslam.scenario import Scenario, load_scenario
from dqslam.sweep.settings import TrialSettings

Location = tuple[str | int, ...]


@dataclass(frozen=True)
class Cell:
    """One combination of values: what differs from other cells, and all the settings."""

    values: Mapping[str, Any]
    """Of each varied setting, by its dotted name."""
    settings: TrialSettings


@dataclass(frozen=True)
class Sweep:
    """Cells, each to be run with the same seeds."""

    scenario: str
    """Name of the scenario that all cells are variations of."""
    cells: tuple[Cell, ...]
    seeds: tuple[int, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the dotted names of the settings that are varied."""
        return tuple(self.cells[0].values)


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Range(_Model):
    low: float
    high: float
    log: bool = False
    """Whether the logarithm is uniform."""
    whole: bool = False
    """Whether numbers are whole, both ends among them."""

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"low, {self.low:g}, is not below high, {self.high:g}")
        if self.log and self.low <= 0.0:
            raise ValueError("log: low is not above 0")
        if self.whole and (self.log or self.low % 1 or self.high % 1):
            raise ValueError("whole: expected whole low and high, and no log")
        return self

    def draw(self, uniform: float) -> float | int:
        """Turn a number from 0 to 1, without 1, into one of the range."""
        if self.whole:
            return int(self.low + np.floor(uniform * (self.high - self.low + 1.0)))
        if self.log:
            return float(self.low * (self.high / self.low) ** uniform)
        return float(self.low + (self.high - self.low) * uniform)


class _File(_Model):
    """What a file may say at its top; its tables are checked setting by setting."""

    scenario: str
    trials: Annotated[int, Field(ge=1)] = 50
    """Seeds of each cell."""
    seed: Annotated[int, Field(ge=0)] = 0
    """The first of them."""
    bound: bool = False
    samples: Annotated[int, Field(ge=1)] = 1
    """Random samples, each crossed with the whole grid."""
    sample_seed: Annotated[int, Field(ge=0)] = 0
    fixed: dict[str, Any] = {}
    grid: dict[str, Any] = {}
    random: dict[str, Any] = {}


@dataclass(frozen=True)
class _Value:
    """A value that a setting takes, and where it stands in the file."""

    location: Location
    value: Any


_Varied = dict[str, list[_Value]]
"""The values of each setting, by its dotted name."""


@dataclass(frozen=True)
class _CellFile(TomlFile):
    """The file, as if it said the settings of one cell."""

    cell_lines: Mapping[Location, int]

    @cached_property
    def lines(self) -> dict[Location, int]:
        """The line of each setting that the file gives a value."""
        return dict(self.cell_lines)


def load_sweep(path: str | Path) -> Sweep:
    """Read the file of a sweep.

    Raises
    ------
    FileError
        When the file, or the scenario that it names, is missing or is none; with every wrong
        setting and value, and the line of each.
    """
    file = read_toml(path)
    mistakes: list[FileError] = []
    said = _top(file, mistakes)
    scenario = _scenario(file, said, mistakes)
    fixed = {
        name: [_Value(location, value)] for name, location, value in _leaves(("fixed",), said.fixed)
    }
    grid, random = _grid(file, said, mistakes), _random(file, said, mistakes)
    _refuse_twice(file, (fixed, grid, random), mistakes)
    _refuse_unknown(file, scenario, said, mistakes)
    cells = []
    for values, places in _combinations(said.samples, fixed, grid, random):
        try:
            content, as_cell = _cell(file, said, scenario, values, places)
            settings = check_model(TrialSettings, content, as_cell)
        except FileErrors as error:
            mistakes += error.errors
        else:
            varied = {name: value for name, value in values.items() if name not in fixed}
            cells.append(Cell(varied, settings))
    if mistakes or scenario is None:  # a wrong value makes one in each cell
        raise FileErrors(list({str(mistake): mistake for mistake in mistakes}.values()))
    return Sweep(scenario.name, tuple(cells), tuple(range(said.seed, said.seed + said.trials)))


def _top(file: TomlFile, mistakes: list[FileError]) -> _File:
    """Check the top; for what is wrong there the default stands in, so that the rest is checked."""
    try:
        return check_model(_File, file.content, file)
    except FileErrors as error:
        mistakes += error.errors
        return _File.model_validate({"scenario": ""} | right_keys(_File, file.content))


def _scenario(file: TomlFile, said: _File, mistakes: list[FileError]) -> Scenario | None:
    """Load the scenario; None where it is wrong."""
    if not isinstance(file.content.get("scenario"), str):
        return None  # as was said of the top
    beside = file.path.parent / said.scenario
    try:
        return load_scenario(beside if beside.is_file() else said.scenario)
    except FileNotFoundError as error:
        mistakes.append(file.error(("scenario",), f"scenario: {error}"))
    except FileErrors as error:
        mistakes += error.errors
    except FileError as error:
        mistakes.append(error)
    return None


def _leaves(location: Location, table: Mapping[str, Any]) -> Iterator[tuple[str, Location, Any]]:
    """Yield dotted name, location and value of what is inside; names may be in quotes or not."""
    for key, value in table.items():
        here = (*location, key)
        if isinstance(value, dict) and not _Range.model_fields.keys() & value.keys():
            yield from _leaves(here, value)
        else:
            yield ".".join(map(str, here[1:])), here, value


def _grid(file: TomlFile, said: _File, mistakes: list[FileError]) -> _Varied:
    grid: _Varied = {}
    for name, location, values in _leaves(("grid",), said.grid):
        if not isinstance(values, list) or not values:
            mistakes.append(file.error(location, f"{name}: expected values, like [1, 2]"))
            continue
        for index, value in enumerate(values):
            if value in values[:index]:
                mistakes.append(file.error((*location, index), f"{name}: {value!r} stands twice"))
        grid[name] = [_Value((*location, index), value) for index, value in enumerate(values)]
    return grid


def _random(file: TomlFile, said: _File, mistakes: list[FileError]) -> _Varied:
    """Draw values; those of a setting depend on nothing else, so that more samples add to them."""
    if said.samples > 1 and not said.random:
        mistakes.append(file.error(("samples",), "samples: no setting is random"))
    random: _Varied = {}
    for name, location, limits in _leaves(("random",), said.random):
        if not isinstance(limits, dict):
            message = f"{name}: expected a range, like {{ low = 1.0, high = 2.0 }}"
            mistakes.append(file.error(location, message))
            continue
        named: Any = create_model("Named", __base__=_Model, limits=(_Range, Field(alias=name)))
        depth = len(location)
        lines = {
            (name, *one[depth:]): line
            for one, line in file.lines.items()
            if one[:depth] == location
        }
        try:
            checked: Any = check_model(named, {name: limits}, _CellFile(file.path, "", {}, lines))
        except FileErrors as error:
            mistakes += error.errors
            continue
        draws = np.random.default_rng([said.sample_seed, *name.encode()]).random(said.samples)
        random[name] = [_Value(location, checked.limits.draw(draw)) for draw in draws.tolist()]
    return random


def _refuse_twice(file: TomlFile, tables: Sequence[_Varied], mistakes: list[FileError]) -> None:
    seen: set[str] = set()
    for name, values in [item for table in tables for item in table.items()]:
        if name in seen:
            mistakes.append(file.error(values[0].location, f"{name} is in another table too"))
        seen.add(name)


def _refuse_unknown(
    file: TomlFile, scenario: Scenario | None, said: _File, mistakes: list[FileError]
) -> None:
    """Refuse misspelt names whose values are wrong too, which are part of no cell."""
    for table in ("grid", "random"):
        for name, place, value in _leaves((table,), getattr(said, table)):
            content, as_cell = _cell(file, said, scenario, {name: value}, {name: place})
            mistakes += unknown_keys(TrialSettings, content, as_cell)


def _combinations(
    samples: int, fixed: _Varied, grid: _Varied, random: _Varied
) -> Iterator[tuple[dict[str, Any], dict[str, Location]]]:
    """Yield the values of each cell and their locations: the grid, its last setting fastest."""
    for chosen in product(*grid.values()):
        for sample in range(samples):
            cell = {name: values[0] for name, values in fixed.items()}
            cell |= dict(zip(grid, chosen, strict=True))
            cell |= {name: values[sample] for name, values in random.items()}
            yield (
                {name: one.value for name, one in cell.items()},
                {name: one.location for name, one in cell.items()},
            )


def _cell(
    file: TomlFile,
    said: _File,
    scenario: Scenario | None,
    values: Mapping[str, Any],
    places: Mapping[str, Location],
) -> tuple[dict[str, Any], _CellFile]:
    """Put values into the settings of a scenario and of the default estimator.

    Without a scenario its settings are left out: nobody knows which are right.
    """
    if scenario is None:
        scenario = load_scenario("paper")
        values = {name: value for name, value in values.items() if name.split(".")[0] != "scenario"}
    content: dict[str, Any] = {
        "scenario": scenario.model_dump(),
        "estimator": {},
        "bound": said.bound,
    }
    lines: dict[Location, int] = {}
    if ("bound",) in file.lines:
        lines[("bound",)] = file.lines[("bound",)]
    for name, value in values.items():
        steps = tuple(name.split("."))
        line = _line(file, places[name])
        for length in range(len(steps), 0, -1):
            lines.setdefault(steps[:length], line)
        table = content
        for step in steps[:-1]:
            if not isinstance(table.get(step), dict):
                table[step] = {}
            table = table[step]
        table[steps[-1]] = value
    return content, _CellFile(file.path, "", content, lines)


def _line(file: TomlFile, location: Location) -> int:
    return next(
        file.lines[location[:length]]
        for length in range(len(location), 0, -1)
        if location[:length] in file.lines
    )
