"""Rules of where objects of a class are, from a TOML table."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from dqslam.config import load_toml_model

PLANE, GROUND = "plane", "ground"


@dataclass(frozen=True)
class PlacementRule:
    """Where the objects of a class are; it may be wrong for some of them."""

    kind: Literal["on", "beside", "aligned", "upright"]
    class_name: str | None = None
    """The class that it holds for; None for all objects."""
    other: str | None = None
    """The class of the object that is referred to. For "on" also "plane", one of the horizontal
    planes that several objects stand on, or "ground", a single one."""
    sigma: float = 0.05
    """Meters for "on" and "beside", radians for "aligned" and "upright"."""
    distance: float = 0.0
    """The largest horizontal distance of the centers, meters, for "beside"."""


@dataclass(frozen=True)
class PlacementRules:
    """Rules, and what they mean by up."""

    rules: tuple[PlacementRule, ...]
    up: tuple[float, float, float] | None = None
    """A unit vector in the world; None where it is that of the scene priors, by default z."""
    up_sigma: float | None = None
    """By how much it may be off about each horizontal axis, radians; it is then estimated from the
    planes that objects stand on. None where it is exact."""


class _Rule(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    class_name: Annotated[str | None, Field(alias="class")] = None
    on: str | None = None
    beside: str | None = None
    within_m: Annotated[float | None, Field(gt=0.0)] = None
    aligned_with: str | None = None
    upright: Literal[True] | None = None
    sigma_m: Annotated[float | None, Field(ge=1e-6)] = None
    sigma_deg: Annotated[float | None, Field(ge=1e-6)] = None

    @model_validator(mode="after")
    def _is_one_rule(self) -> _Rule:
        kinds = {
            "on": self.on,
            "beside": self.beside,
            "aligned_with": self.aligned_with,
            "upright": self.upright,
        }
        given = [name for name, value in kinds.items() if value is not None]
        if len(given) != 1:
            raise ValueError(f"needs one of {', '.join(kinds)}, has {', '.join(given) or 'none'}")
        if (self.within_m is None) == (self.beside is not None):
            raise ValueError("within_m goes with beside")
        is_angle = self.aligned_with is not None or self.upright is not None
        if (self.sigma_m if is_angle else self.sigma_deg) is not None:
            unit = "sigma_deg" if is_angle else "sigma_m"
            raise ValueError(f"the sigma of {given[0]} is {unit}")
        return self

    def rule(self) -> PlacementRule:
        meters = 0.05 if self.sigma_m is None else self.sigma_m
        radians = float(np.deg2rad(5.0 if self.sigma_deg is None else self.sigma_deg))
        if self.on is not None:
            return PlacementRule("on", self.class_name, self.on, meters)
        if self.beside is not None:
            distance = self.within_m or 0.0
            return PlacementRule("beside", self.class_name, self.beside, meters, distance)
        if self.aligned_with is not None:
            return PlacementRule("aligned", self.class_name, self.aligned_with, radians)
        return PlacementRule("upright", self.class_name, None, radians)


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")
    placements: Annotated[list[_Rule], Field(min_length=1)]
    up: tuple[float, float, float] | None = None
    up_sigma_deg: Annotated[float | None, Field(ge=1e-3, le=90.0)] = None

    @field_validator("up")
    @classmethod
    def _has_a_length(cls, up: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if up is not None and not 1e-6 < float(np.linalg.norm(up)) < 1e6:
            raise ValueError("up must be a direction")
        return up

    def unit_up(self) -> tuple[float, float, float] | None:
        if self.up is None:
            return None
        x, y, z = (np.array(self.up) / np.linalg.norm(self.up)).tolist()
        return x, y, z


def load_placements(path: str | Path) -> PlacementRules:
    """Read rules of where objects are from a TOML file.

    It has a table ``[[placements]]`` for each rule. ``class`` names the objects that it holds for,
    all without it. One of these says where they are:

    - ``on = "plane"``, ``"ground"``, or a class, with ``sigma_m`` (0.05);
    - ``beside = "monitor"`` with ``within_m``, the largest horizontal distance, and ``sigma_m``;
    - ``aligned_with = "desk"`` with ``sigma_deg`` (5), for the horizontal axes of the nearest one;
    - ``upright = true`` with ``sigma_deg`` (5).

    ``up = [0, -1, 0]`` above the first table is the direction up in the world, by default z, and
    ``up_sigma_deg = 5`` says by how much it may be off: it is then estimated.

    Raises
    ------
    FileError
        If the file is missing or is not such a table; the error names the line of every wrong
        setting.
    """
    table = load_toml_model(path, _Table)
    rules = tuple(entry.rule() for entry in table.placements)
    sigma = table.up_sigma_deg
    return PlacementRules(
        rules, table.unit_up(), None if sigma is None else float(np.deg2rad(sigma))
    )


def check_placement_classes(rules: Sequence[PlacementRule], known: Collection[str]) -> None:
    """Raise a ValueError that names the first unknown class and the known ones."""
    for rule in rules:
        for name in (rule.class_name, rule.other):
            if name is not None and name not in known and name not in (PLANE, GROUND):
                names = ", ".join(sorted(known))
                raise ValueError(f"placements: no class {name!r} in the recording, only: {names}")
