"""A list of objects in a JSON file, each with its line."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dqslam.io.files import FileError

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
        """Return a finite number; null counts as missing."""
        value = self.value(key) if default is None else self.fields.get(key)
        if value is None and default is not None:
            return default
        return self._number(key, value)

    def numbers(self, key: str, count: int) -> list[float]:
        """Return a list of finite numbers with the given length."""
        values = self.value(key)
        if not isinstance(values, list) or len(values) != count:
            raise self.error(f"{key} is not a list of {count} numbers")
        return [self._number(key, value) for value in values]

    def integer(self, key: str, default: int | None = None) -> int:
        """Return a whole number; null counts as missing."""
        value = self.number(key, default)
        if value != math.floor(value) or abs(value) >= 2.0**53:
            raise self.error(f"{key} is {value:g}, not a whole number")
        return int(value)

    def text(self, key: str) -> str:
        """Return a text."""
        value = self.value(key)
        if not isinstance(value, str):
            raise self.error(f"{key} is {value!r}, not a text")
        return value

    def _number(self, key: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(f"{key} is {value!r}, not a number")
        if not math.isfinite(value):
            raise self.error(f"{key} is {value}, not finite")
        return float(value)


def parse_entries(path: str | Path, text: str, key: str) -> tuple[list[Entry], dict[str, Any]]:
    """Parse a list of objects, or the one under ``key`` of a table; also return the rest of it."""
    decoder = json.JSONDecoder()
    try:
        start = SPACE.match(text).end()  # type: ignore[union-attr]
        rest: Any = {}
        if text[start] == "{":
            rest = json.loads(text)
            if not isinstance(rest.get(key), list):
                raise FileError(path, f"no list {key} (it has: {', '.join(rest)})")
            start = re.search(rf'"{key}"\s*:\s*(?=\[)', text).end()  # type: ignore[union-attr]
        if text[start] != "[":
            raise FileError(path, "is neither a list nor a table of one")
        return _scan(path, text, start + 1, decoder), rest
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None


def _scan(path: str | Path, text: str, at: int, decoder: json.JSONDecoder) -> list[Entry]:
    """Decode one item after the other, counting lines."""
    entries: list[Entry] = []
    line, counted = 1, 0
    at = SPACE.match(text, at).end()  # type: ignore[union-attr]
    while text[at : at + 1] != "]":
        line += text.count("\n", counted, at)
        counted = at
        fields, at = decoder.raw_decode(text, at)
        if not isinstance(fields, dict):
            raise FileError(path, f"entry {len(entries)} is no table of named values", line)
        entries.append(Entry(path, len(entries), line, fields))
        at = SPACE.match(text, at).end()  # type: ignore[union-attr]
        if text[at : at + 1] == ",":
            at = SPACE.match(text, at + 1).end()  # type: ignore[union-attr]
        elif text[at : at + 1] != "]":
            raise json.JSONDecodeError("expected ',' or ']'", text, at)
    return entries
