"""The varied settings of a sweep and their values: from tables of a file to combinations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator

from dqslam._files import FileError, FileErrors
from dqslam.config import TomlFile, check_model

Location = tuple[str | int, ...]


class FileModel(BaseModel):
    """The settings that a sweep's file may have; other keys and infinity are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Range(FileModel):
    """The range from which a setting is drawn."""

    low: float
    high: float
    log: bool = False
    """Whether the logarithm is uniform, not the value."""
    whole: bool = False
    """Whether values are whole numbers, both ends included."""

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
        """Map a number in [0, 1) to the range."""
        if self.whole:
            return int(self.low + np.floor(uniform * (self.high - self.low + 1.0)))
        if self.log:
            return float(self.low * (self.high / self.low) ** uniform)
        return float(self.low + (self.high - self.low) * uniform)


@dataclass(frozen=True)
class Value:
    """A value of a setting, and its location in the file."""

    location: Location
    value: Any


Varied = dict[str, list[Value]]
"""The values of each setting, by its dotted name."""


@dataclass(frozen=True)
class CellFile(TomlFile):
    """The file, as if it had the settings of one cell."""

    cell_lines: Mapping[Location, int]

    @cached_property
    def lines(self) -> dict[Location, int]:
        """The line of each setting that the file gives a value."""
        return dict(self.cell_lines)


def leaves(location: Location, table: Mapping[str, Any]) -> Iterator[tuple[str, Location, Any]]:
    """Yield dotted name, location and value of each setting; names may be in quotes or not."""
    for key, value in table.items():
        here = (*location, key)
        if isinstance(value, dict) and not Range.model_fields.keys() & value.keys():
            yield from leaves(here, value)
        else:
            yield ".".join(map(str, here[1:])), here, value


def read_grid(file: TomlFile, table: Mapping[str, Any], mistakes: list[FileError]) -> Varied:
    """Read the values of each setting."""
    grid: Varied = {}
    for name, location, values in leaves(("grid",), table):
        if not isinstance(values, list) or not values:
            mistakes.append(file.error(location, f"{name}: expected values, like [1, 2]"))
            continue
        for index, value in enumerate(values):
            if value in values[:index]:
                mistakes.append(file.error((*location, index), f"{name}: {value!r} occurs twice"))
        grid[name] = [Value((*location, index), value) for index, value in enumerate(values)]
    return grid


def read_random(
    file: TomlFile,
    table: Mapping[str, Any],
    mistakes: list[FileError],
    *,
    samples: int,
    seed: int,
) -> Varied:
    """Draw values; those of a setting depend on nothing else, so more samples only add values."""
    if samples > 1 and not table:
        mistakes.append(file.error(("samples",), "samples: no setting is random"))
    random: Varied = {}
    for name, location, limits in leaves(("random",), table):
        if not isinstance(limits, dict):
            message = f"{name}: expected a range, like {{ low = 1.0, high = 2.0 }}"
            mistakes.append(file.error(location, message))
            continue
        named: Any = create_model("Named", __base__=FileModel, limits=(Range, Field(alias=name)))
        depth = len(location)
        lines = {
            (name, *one[depth:]): line
            for one, line in file.lines.items()
            if one[:depth] == location
        }
        try:
            checked: Any = check_model(named, {name: limits}, CellFile(file.path, "", {}, lines))
        except FileErrors as error:
            mistakes += error.errors
            continue
        draws = np.random.default_rng([seed, *name.encode()]).random(samples)
        random[name] = [Value(location, checked.limits.draw(draw)) for draw in draws.tolist()]
    return random


def refuse_twice(file: TomlFile, tables: Sequence[Varied], mistakes: list[FileError]) -> None:
    """Refuse a setting that is in two tables."""
    seen: set[str] = set()
    for name, values in [item for table in tables for item in table.items()]:
        if name in seen:
            mistakes.append(file.error(values[0].location, f"{name} is in another table too"))
        seen.add(name)


def combinations(
    samples: int, fixed: Varied, grid: Varied, random: Varied
) -> Iterator[tuple[dict[str, Any], dict[str, Location]]]:
    """Yield values and locations of each cell; the last setting of the grid changes fastest."""
    for chosen in product(*grid.values()):
        for sample in range(samples):
            cell = {name: values[0] for name, values in fixed.items()}
            cell |= dict(zip(grid, chosen, strict=True))
            cell |= {name: values[sample] for name, values in random.items()}
            yield (
                {name: one.value for name, one in cell.items()},
                {name: one.location for name, one in cell.items()},
            )
