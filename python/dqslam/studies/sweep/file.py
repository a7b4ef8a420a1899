"""The file of a sweep: the settings that are varied, and the resulting cells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from dqslam._files import FileError, FileErrors
from dqslam.config import TomlFile, check_model, read_toml, right_keys, unknown_keys
from dqslam.simulation.scenario import Scenario, load_scenario
from dqslam.studies.sweep.settings import TrialSettings
from dqslam.studies.sweep.varied import (
    CellFile,
    FileModel,
    Location,
    Value,
    combinations,
    leaves,
    read_grid,
    read_random,
    refuse_twice,
)

MOST = 1_000_000  #: trials of a cell, samples, and cells; a larger number is a slip


@dataclass(frozen=True)
class Cell:
    """One combination of values: the settings that differ between cells, and all settings."""

    values: Mapping[str, Any]
    """Value of each varied setting, by its dotted name."""
    settings: TrialSettings


@dataclass(frozen=True)
class Sweep:
    """Cells, each to be run with the same seeds."""

    scenario: str
    """Name of the scenario that all cells vary."""
    cells: tuple[Cell, ...]
    seeds: tuple[int, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the dotted names of the settings that are varied."""
        return tuple(self.cells[0].values)


class _File(FileModel):
    """The settings at the top of a file. Its tables are checked setting by setting."""

    scenario: str
    trials: Annotated[int, Field(ge=1, le=MOST)] = 50
    """Number of seeds of each cell."""
    seed: Annotated[int, Field(ge=0)] = 0
    """The first seed."""
    bound: bool = False
    """Whether to compare with the posterior bound and the optimum."""
    samples: Annotated[int, Field(ge=1, le=MOST)] = 1
    """Number of random samples, each combined with every cell of the grid."""
    sample_seed: Annotated[int, Field(ge=0)] = 0
    fixed: dict[str, Any] = {}
    grid: dict[str, Any] = {}
    random: dict[str, Any] = {}


def load_sweep(path: str | Path) -> Sweep:
    """Read the file of a sweep.

    Raises
    ------
    FileError
        If the file, or the scenario that it names, is missing or invalid; the error lists every
        wrong setting and value with its line.
    """
    file = read_toml(path)
    mistakes: list[FileError] = []
    top = _top(file, mistakes)
    scenario = _scenario(file, top, mistakes)
    fixed = {
        name: [Value(location, value)] for name, location, value in leaves(("fixed",), top.fixed)
    }
    grid = read_grid(file, top.grid, mistakes)
    random = read_random(file, top.random, mistakes, samples=top.samples, seed=top.sample_seed)
    refuse_twice(file, (fixed, grid, random), mistakes)
    _refuse_unknown(file, scenario, top, mistakes)
    count = top.samples * math.prod(len(values) for values in grid.values())
    if count > MOST:
        raise FileError(file.path, f"it has {count} cells, more than {MOST}")
    cells = []
    for values, places in combinations(top.samples, fixed, grid, random):
        try:
            content, as_cell = _cell(file, top, scenario, values, places)
            settings = check_model(TrialSettings, content, as_cell)
        except FileErrors as error:
            mistakes += error.errors
        else:
            varied = {name: value for name, value in values.items() if name not in fixed}
            cells.append(Cell(varied, settings))
    if mistakes or scenario is None:  # a wrong value makes a mistake in each cell
        raise FileErrors(list({str(mistake): mistake for mistake in mistakes}.values()))
    return Sweep(scenario.name, tuple(cells), tuple(range(top.seed, top.seed + top.trials)))


def _top(file: TomlFile, mistakes: list[FileError]) -> _File:
    """Check the top; a default replaces a wrong setting, so that the other ones are checked too."""
    try:
        return check_model(_File, file.content, file)
    except FileErrors as error:
        mistakes += error.errors
        return _File.model_validate({"scenario": ""} | right_keys(_File, file.content))


def _scenario(file: TomlFile, top: _File, mistakes: list[FileError]) -> Scenario | None:
    """Load the scenario; return None if it is wrong."""
    if not isinstance(file.content.get("scenario"), str):
        return None  # the mistake at the top is reported already
    beside = file.path.parent / top.scenario
    try:
        return load_scenario(beside if beside.is_file() else top.scenario)
    except FileNotFoundError as error:
        mistakes.append(file.error(("scenario",), f"scenario: {error}"))
    except FileErrors as error:
        mistakes += error.errors
    except FileError as error:
        mistakes.append(error)
    return None


def _refuse_unknown(
    file: TomlFile, scenario: Scenario | None, top: _File, mistakes: list[FileError]
) -> None:
    """Refuse misspelled names that are in no cell because their values are wrong too."""
    for table in ("grid", "random"):
        for name, place, value in leaves((table,), getattr(top, table)):
            content, as_cell = _cell(file, top, scenario, {name: value}, {name: place})
            mistakes += unknown_keys(TrialSettings, content, as_cell)


def _cell(
    file: TomlFile,
    top: _File,
    scenario: Scenario | None,
    values: Mapping[str, Any],
    places: Mapping[str, Location],
) -> tuple[dict[str, Any], CellFile]:
    """Put values into the settings of a scenario and of the default estimator.

    Without a scenario its settings are left out, because they cannot be checked.
    """
    if scenario is None:
        scenario = load_scenario("paper")
        values = {name: value for name, value in values.items() if name.split(".")[0] != "scenario"}
    content: dict[str, Any] = {
        "scenario": scenario.model_dump(),
        "estimator": {},
        "bound": top.bound,
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
    return content, CellFile(file.path, "", content, lines)


def _line(file: TomlFile, location: Location) -> int:
    return next(
        file.lines[location[:length]]
        for length in range(len(location), 0, -1)
        if location[:length] in file.lines
    )
