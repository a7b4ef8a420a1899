"""Lists of objects in JSON and JSON-lines files, each object with its line."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dqslam.io.files import FileError, in_reach

SPACE = re.compile(r"[ \t\n\r]*")


@dataclass(frozen=True)
class Entry:
    """One object of the list; its values are checked when they are read."""

    path: str | Path
    index: int  #: from 0
    line: int
    fields: dict[str, Any]

    def error(self, message: str) -> FileError:
        """Return an error that names the file, the line and the entry."""
        return FileError(self.path, f"entry {self.index}: {message}", self.line)

    def value(self, key: str) -> Any:
        """Return a required value."""
        if key not in self.fields:
            raise self.error(f"missing {key} (it has: {', '.join(self.fields)})")
        return self.fields[key]

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number, NaN if it is not in reach; null counts as missing."""
        value = self.value(key) if default is None else self.fields.get(key)
        if value is None and default is not None:
            return default
        return self._number(key, value)

    def numbers(self, key: str, count: int) -> list[float]:
        """Return a list of numbers with the given length, NaN where one is not in reach."""
        values = self.value(key)
        if not isinstance(values, list) or len(values) != count:
            raise self.error(f"{key} is not a list of {count} numbers")
        return [self._number(key, value) for value in values]

    def integer(self, key: str) -> int:
        """Return a whole number."""
        value = self.number(key)
        if not math.isfinite(value) or value != math.floor(value) or abs(value) >= 2.0**53:
            raise self.error(f"{key} is {value:g}, not a whole number")
        return int(value)

    def text(self, key: str) -> str:
        """Return a text."""
        value = self.value(key)
        if not isinstance(value, str):
            raise self.error(f"{key} is {value!r}, not a text")
        return value

    def label(self, key: str) -> str:
        """Return an id or a class as text, "" if it is missing or null."""
        value = self.fields.get(key)
        if value is None:
            return ""
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise self.error(f"{key} is {value!r}, not a name or a number")
        return str(value)

    def _number(self, key: str, value: Any) -> float:
        if value is None:
            return math.nan
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"{key} is {value!r}, not a number")
        try:
            return float(in_reach(np.array(float(value))))
        except OverflowError:  # a whole number of hundreds of digits
            return math.nan


def parse_entries(path: str | Path, text: str, key: str) -> tuple[list[Entry], dict[str, Any]]:
    """Parse a list of objects, or the one under ``key`` of a table; also return the rest of it.

    Only the list at the top of the table counts, not one within other values.
    """
    decoder = json.JSONDecoder()
    try:
        start = _skip(text, 0)
        if text[start] == "[":
            entries, end = _scan(path, text, start + 1, decoder)
            rest: dict[str, Any] = {}
        elif text[start] == "{":
            entries, rest, end = _scan_table(path, text, start + 1, key, decoder)
        else:
            raise FileError(path, "is neither a list nor a table of one")
        if _skip(text, end) != len(text):
            raise json.JSONDecodeError("text after its end", text, _skip(text, end))
        return entries, rest
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None


def parse_lines(path: str | Path, text: str) -> list[Entry]:
    """Parse a file with one object in each line (JSON lines)."""
    entries: list[Entry] = []
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.strip():
            continue
        try:
            fields = json.loads(line)
        except json.JSONDecodeError as error:
            raise FileError(path, f"not JSON: {error.msg}", number) from None
        except RecursionError:
            raise FileError(path, "nested too deeply", number) from None
        if not isinstance(fields, dict):
            raise FileError(path, "is no table of named values", number)
        entries.append(Entry(path, len(entries), number, fields))
    return entries


def _skip(text: str, at: int) -> int:
    """Return the place of the next character that is not a space."""
    return SPACE.match(text, at).end()  # type: ignore[union-attr]


def _scan_table(
    path: str | Path, text: str, at: int, key: str, decoder: json.JSONDecoder
) -> tuple[list[Entry], dict[str, Any], int]:
    """Decode a table value by value, the list under ``key`` item by item."""
    entries: list[Entry] | None = None
    rest: dict[str, Any] = {}
    at = _skip(text, at)
    while text[at : at + 1] != "}":
        name, at = decoder.raw_decode(text, at)
        at = _skip(text, at)
        if not isinstance(name, str) or text[at : at + 1] != ":":
            raise json.JSONDecodeError("expected a name and ':'", text, at)
        at = _skip(text, at + 1)
        if name == key and text[at : at + 1] == "[":
            if entries is not None:
                raise FileError(path, f"has two lists {key}", text.count("\n", 0, at) + 1)
            entries, at = _scan(path, text, at + 1, decoder)
        else:
            rest[name], at = decoder.raw_decode(text, at)
        at = _next(text, at, "}")
    if entries is None:
        raise FileError(path, f"no list {key} (it has: {', '.join(rest)})")
    return entries, rest, at + 1


def _scan(
    path: str | Path, text: str, at: int, decoder: json.JSONDecoder
) -> tuple[list[Entry], int]:
    """Decode one item of a list after the other, counting lines; also return the list's end."""
    entries: list[Entry] = []
    line, counted = 1 + text.count("\n", 0, at), at
    at = _skip(text, at)
    while text[at : at + 1] != "]":
        line += text.count("\n", counted, at)
        counted = at
        fields, at = decoder.raw_decode(text, at)
        if not isinstance(fields, dict):
            raise FileError(path, f"entry {len(entries)} is no table of named values", line)
        entries.append(Entry(path, len(entries), line, fields))
        at = _next(text, at, "]")
    return entries, at + 1


def _next(text: str, at: int, end: str) -> int:
    """Return the place of the next item after a comma, or of the end."""
    at = _skip(text, at)
    if text[at : at + 1] == ",":
        return _skip(text, at + 1)
    if text[at : at + 1] != end:
        raise json.JSONDecodeError(f"expected ',' or '{end}'", text, at)
    return at
