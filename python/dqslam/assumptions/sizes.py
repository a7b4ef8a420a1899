"""Prior sizes of objects: one prior for all, or a table with one for each class."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from dqslam.config import load_toml_model


@dataclass(frozen=True)
class SizePrior:
    """A log-normal prior on the semi-axes, which is broad on purpose."""

    log_mean: float = float(np.log(0.3))
    """Natural logarithm of the median semi-axis in meters."""
    log_sigma: float = 0.7
    """Standard deviation of the logarithm."""
    median_log_sigma: float = 0.0
    """Standard deviation of `log_mean` itself. If it is not 0, the median is estimated with the
    map, one for all objects that have this prior."""

    def of(self, class_name: str) -> Self:
        """Return the prior of a class: all have the same."""
        return self


UNKNOWN_SIZE = SizePrior(median_log_sigma=float(np.log(10.0)))
"""The default: two of three semi-axes are within a factor of 2 of a median that is estimated, and
which is 0.3 m within a factor of 10."""


@dataclass(frozen=True)
class SizePriors:
    """Size priors by the name of the class, and one for all other classes."""

    classes: Mapping[str, SizePrior]
    default: SizePrior = UNKNOWN_SIZE

    def of(self, class_name: str) -> SizePrior:
        """Return the prior of a class."""
        return self.classes.get(class_name, self.default)

    def check_classes(self, known: Collection[str]) -> None:
        """Raise a ValueError that names the first unknown class and the known ones."""
        for name in self.classes:
            if name not in known:
                names = ", ".join(sorted(known))
                raise ValueError(f"size priors: no class {name!r} in the recording, only: {names}")


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    median_m: Annotated[float, Field(gt=0.0)]
    spread: Annotated[float, Field(gt=1.0)]
    median_spread: Annotated[float, Field(ge=1.0)] = 1.0

    def prior(self) -> SizePrior:
        return SizePrior(
            float(np.log(self.median_m)),
            float(np.log(self.spread)),
            float(np.log(self.median_spread)),
        )


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")
    default: _Entry | None = None
    classes: dict[str, _Entry] = {}


def load_size_priors(path: str | Path) -> SizePriors:
    """Read a table of size priors from a TOML file.

    It has a table ``[classes.NAME]`` for each class and may have a table ``[default]`` for all
    others. Each has ``median_m``, the median semi-axis in meters, and ``spread``, a factor above 1:
    two of three semi-axes are between median / spread and median * spread. It may have
    ``median_spread``, a factor of 1 or above: by as much the median itself is uncertain, and it is
    then estimated with the map.

    Raises
    ------
    FileError
        If the file is missing or is not such a table; the error names the line of every wrong
        setting.
    """
    table = load_toml_model(path, _Table)
    classes = {name: entry.prior() for name, entry in table.classes.items()}
    return SizePriors(classes, UNKNOWN_SIZE if table.default is None else table.default.prior())
