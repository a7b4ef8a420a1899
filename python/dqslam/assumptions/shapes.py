"""The shapes of objects: one for all, or a table with one for each class."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from dqslam._core import Shape
from dqslam.config import load_toml_model

ShapeName = Literal["auto", "ellipsoid", "cuboid", "cylinder"]


@dataclass(frozen=True)
class ClassShapes:
    """Shapes by the name of the class, and one for all other classes."""

    classes: Mapping[str, Shape]
    default: Shape = Shape.ELLIPSOID


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")
    default: ShapeName = "ellipsoid"
    classes: dict[str, ShapeName] = {}


def load_shapes(path: str | Path) -> ClassShapes:
    """Read a table of shapes from a TOML file.

    It has a table ``[classes]`` with lines like ``can = "cylinder"``, and may have ``default``, the
    shape of all other classes. A shape is "auto", "ellipsoid", "cuboid" or "cylinder".

    Raises
    ------
    FileError
        If the file is missing or is not such a table; the error names the line of every wrong
        setting.
    """
    table = load_toml_model(path, _Table)
    classes = {name: Shape[shape.upper()] for name, shape in table.classes.items()}
    return ClassShapes(classes, Shape[table.default.upper()])
