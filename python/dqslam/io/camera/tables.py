"""Named values of a camera file, with errors that name file, line and key."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from dqslam._limits import IN_REACH, LARGEST_NUMBER
from dqslam.io.files import FileError, read_text


@dataclass(frozen=True)
class Table:
    """Named values of a file, or of a part of it."""

    path: str | Path
    text: str
    """All of the file, in which lines are looked for."""
    values: Mapping[str, Any]
    number_texts: bool = False
    """Whether texts may be numbers, as in YAML 1.1, where 1e-05 is one, and in XML."""

    def part(self, values: Mapping[str, Any]) -> Table:
        """Return a table with other values of the same file."""
        return replace(self, values=values)

    def line_of(self, key: str) -> int | None:
        """Find the first line that sets a key, or None if there is no such line."""
        pattern = re.compile(rf"(?<![\w-])<?[\"']?{re.escape(key)}[\"']?\s*[:=\]>]")
        for number, line in enumerate(self.text.split("\n"), start=1):
            if pattern.search(line):
                return number
        return None

    def error(self, message: str, key: str | None = None) -> FileError:
        """Make an error that names the file, and the line of a key."""
        return FileError(self.path, message, None if key is None else self.line_of(key))

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self.values[key]
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        return self._number(key, value)

    def numbers(self, key: str) -> list[float]:
        """Return a list of finite numbers: of a list, of rows, or of a matrix with its data."""
        value = self.values[key]
        rows = columns = None
        if isinstance(value, Mapping):
            rows, columns = value.get("rows"), value.get("cols")
            value = value.get("data")
        if value is None:
            value = []
        if isinstance(value, str) and self.number_texts:
            value = value.replace(",", " ").split()
        if isinstance(value, str) or not hasattr(value, "__iter__"):
            raise self.error(f"{key} is no list of numbers", key)
        cells: list[Any] = []
        for cell in value:
            cells += list(cell) if isinstance(cell, list | tuple) else [cell]
        if isinstance(rows, int) and isinstance(columns, int) and rows * columns != len(cells):
            message = f"{key} has {len(cells)} numbers, not {rows} rows of {columns}"
            raise self.error(message, key)
        return [self._number(key, cell) for cell in cells]

    def _number(self, key: str, value: Any) -> float:
        if isinstance(value, str) and self.number_texts:
            try:
                value = float(value)
            except ValueError:
                raise self.error(f"{key} holds {value!r}, not a number", key) from None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"{key} is {value!r}, not a number", key)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not abs(number) <= LARGEST_NUMBER:
            raise self.error(f"{key} is {number}, not {IN_REACH}", key)
        return number


def read_json_table(path: str | Path) -> Table:
    """Read a JSON file that holds a table."""
    text = read_text(path)
    try:
        content: Any = json.loads(text, object_pairs_hook=partial(_agreed, path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except ValueError as error:  # a number of thousands of digits
        raise FileError(path, f"not JSON: {error}") from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    return Table(path, text, _table(path, content))


def _agreed(path: str | Path, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a table of JSON, in which a key may be repeated but has one value."""
    table: dict[str, Any] = {}
    for key, value in pairs:
        if key in table and table[key] != value:
            raise FileError(path, f"{key} is there twice, with different values")
        table[key] = value
    return table


def read_toml_table(path: str | Path) -> Table:
    """Read a TOML file."""
    text = read_text(path)
    try:
        return Table(path, text, tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        at = re.search(r"\(at line (\d+)", str(error))
        message = f"not TOML: {str(error).split(' (at ')[0]}"
        raise FileError(path, message, int(at[1]) if at else None) from None
    except ValueError as error:
        raise FileError(path, f"not TOML: {error}") from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None


def read_yaml_table(path: str | Path) -> Table:
    """Read a YAML file that holds a table, also one of OpenCV."""
    from dqslam.io.yaml import parse_yaml

    text = read_text(path)
    return Table(path, text, parse_yaml(path, text), number_texts=True)


def _table(path: str | Path, content: Any) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise FileError(path, "holds no table of named values")
    return content
