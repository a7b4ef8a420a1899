"""The line of each key in a TOML file, which the standard library does not report."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator

Location = tuple[str | int, ...]
"""The keys, and positions in arrays, from the top of the file to a setting."""

_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}'
    r"|'''.*?'{3,5}"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*"
    r"|[\[\]{}=,.\n]"
    r"|[^\s\[\]{}=,.#\"']+",
    re.DOTALL,
)
_END = ""


def key_lines(text: str) -> dict[Location, int]:
    """Return the line, from 1, on which each key and each entry of an array first occurs.

    The text must be valid TOML, because it is not checked here.
    """
    scanner = _Scanner(text)
    scanner.read()
    return scanner.lines


class _Scanner:
    def __init__(self, text: str) -> None:
        self.lines: dict[Location, int] = {}
        self._tokens = _tokens(text)
        self._entries: dict[Location, int] = {}  # number of entries of each array of tables so far
        self._token, self._line = _END, 0
        self._next()

    def read(self) -> None:
        section: Location = ()
        while self._token != _END:
            if self._token == "\n":
                self._next()
            elif self._token == "[":
                section = self._header()
            else:
                self._pair(section)

    def _next(self) -> None:
        self._token, self._line = next(self._tokens)

    def _note(self, location: Location) -> None:
        self.lines.setdefault(location, self._line)

    def _header(self) -> Location:
        """Read [a.b] or [[a.b]], which starts the next entry of an array of tables."""
        self._next()
        is_array = self._token == "["
        if is_array:
            self._next()
        section = self._keys(())
        if is_array:
            count = self._entries[section] = self._entries.get(section, -1) + 1
            section = (*section, count)
            self._note(section)
            self._next()
        self._next()
        return section

    def _keys(self, above: Location) -> Location:
        """Read a key, dotted or not; one that names an array of tables means its last entry."""
        location = above
        while True:
            if location in self._entries:
                location = (*location, self._entries[location])
            location = (*location, _key(self._token))
            self._note(location)
            self._next()
            if self._token != ".":
                return location
            self._next()

    def _pair(self, above: Location) -> None:
        location = self._keys(above)
        self._next()  # the equals sign
        self._value(location)

    def _value(self, location: Location) -> None:
        if self._token == "[":
            self._array(location)
        elif self._token == "{":
            self._table(location)
        else:
            while self._token not in (",", "]", "}", "\n", _END):
                self._next()

    def _array(self, location: Location) -> None:
        self._next()
        count = 0
        while self._token != "]":
            if self._token in (",", "\n"):
                self._next()
                continue
            self._note((*location, count))
            self._value((*location, count))
            count += 1
        self._next()

    def _table(self, location: Location) -> None:
        self._next()
        while self._token != "}":
            if self._token in (",", "\n"):
                self._next()
            else:
                self._pair(location)
        self._next()


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Yield tokens and the lines on which they start; comments are left out."""
    line, seen = 1, 0
    for match in _TOKEN.finditer(text):
        line += text.count("\n", seen, match.start())
        seen = match.start()
        if not match[0].startswith("#"):
            yield match[0], line
    while True:
        yield _END, line


def _key(token: str) -> str:
    """Read a key as the standard library does, quotes and escapes included."""
    return next(iter(tomllib.loads(f"{token} = 0"))) if token[0] in "\"'" else token
