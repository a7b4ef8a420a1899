"""Settings from a TOML file to a pydantic model, with all mistakes at once, each with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from dqslam._files import FileError, FileErrors, read_text
from dqslam.config.lines import Location, key_lines

Model = TypeVar("Model", bound=BaseModel)
MOST_LISTED = 12  # largest number of known keys in a message


@dataclass(frozen=True)
class TomlFile:
    """The content of a TOML file, and the lines of its keys."""

    path: Path
    text: str
    content: dict[str, Any]

    @cached_property
    def lines(self) -> dict[Location, int]:
        """The line of each key."""
        return key_lines(self.text)

    def error(self, location: Location, message: str) -> FileError:
        """Return an error at the line of a key, or else of the innermost section around it."""
        for length in range(len(location), 0, -1):
            if location[:length] in self.lines:
                return FileError(self.path, message, self.lines[location[:length]])
        return FileError(self.path, message)


def read_toml(path: str | Path) -> TomlFile:
    """Read a TOML file.

    Raises
    ------
    FileError
        When the file is missing, empty, or not TOML.
    """
    path = Path(path)
    text = read_text(path).replace("\r\n", "\n")
    try:
        return TomlFile(path, text, tomllib.loads(text))
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        at = re.fullmatch(r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", str(error))
        line = None if at is None else int(at[2] or text.rstrip().count("\n") + 1)
        message = str(error) if at is None else at[1]
        raise FileError(path, f"not a TOML file: {message}", line) from None


def load_toml_model(path: str | Path, model: type[Model]) -> Model:
    """Read a TOML file into a model.

    Raises
    ------
    FileError
        If the file is missing, empty or not TOML. `FileErrors` lists everything that the model
        refuses, one line for each, with a suggestion for a misspelled key.
    """
    file = read_toml(path)
    return check_model(model, file.content, file)


def check_model(model: type[Model], content: Mapping[str, Any], file: TomlFile) -> Model:
    """Make a model of the content of a file, or of its content combined with that of another."""
    try:
        return model.model_validate(dict(content))
    except ValidationError as error:
        mistakes = [_mistake(model, content, file, item) for item in error.errors()]
        raise FileErrors(mistakes) from None


def right_keys(model: type[BaseModel], content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the top-level keys of a file's content that a model accepts."""
    try:
        model.model_validate(dict(content))
    except ValidationError as error:
        wrong = {item["loc"][0] for item in error.errors() if item["loc"]}
        return {key: value for key, value in content.items() if key not in wrong}
    return dict(content)


def unknown_keys(
    model: type[BaseModel], content: Mapping[str, Any], file: TomlFile
) -> list[FileError]:
    """Return the errors of `check_model` about unknown keys, and ignore values."""
    try:
        model.model_validate(dict(content))
    except ValidationError as error:
        unknown = [item for item in error.errors() if item["type"] == "extra_forbidden"]
        return [_mistake(model, content, file, item) for item in unknown]
    return []


def _mistake(
    model: type[BaseModel], content: Mapping[str, Any], file: TomlFile, item: Any
) -> FileError:
    missing = item["type"] == "missing"
    location = _in_file(content, item["loc"], missing=missing)
    name = ".".join(map(str, location))
    if item["type"] == "extra_forbidden":
        text = f"unknown key {name}{_suggestion(model, item['loc'])}"
    elif missing:
        text = f"{name} is missing"
    else:
        value = item.get("input")
        shown = f", not {value!r}" if isinstance(value, str | int | float) else ""
        text = f"{name}: {item['msg'].removeprefix('Value error, ')}{shown}".removeprefix(": ")
    return file.error(location, text)


def _in_file(content: Any, location: Location, *, missing: bool) -> Location:
    """Remove names of kinds and types, which are not in the file, from pydantic's location."""
    found: list[str | int] = []
    for step in location[:-1] if missing else location:
        is_there = step in content if isinstance(content, Mapping) else _is_entry(content, step)
        if is_there:
            found.append(step)
            content = content[step]
    return (*found, location[-1]) if missing else tuple(found)


def _is_entry(content: Any, step: str | int) -> bool:
    return isinstance(content, list) and isinstance(step, int) and step < len(content)


def _suggestion(model: type[BaseModel], location: Location) -> str:
    """Suggest a known key that resembles an unknown one, or else list the known keys."""
    known = _fields(model, location[:-1])
    close = get_close_matches(str(location[-1]), known, n=1)
    if close:
        return f"; did you mean {close[0]}?"
    if not known or len(known) > MOST_LISTED:
        return ""
    return f"; there are: {', '.join(known)}"


def _fields(model: type[BaseModel], location: Location) -> list[str]:
    """Return the names of the settings that may be at a location, for all kinds that fit."""
    models = [model]
    for step in location:
        inside = [_field(one, step) for one in models]
        below = [found for one in inside if one is not None for found in _models(one)]
        # Otherwise it is not a key, but the kind of a union's member.
        models = below or [one for one in models if step in _kinds(one)] or models
    names = (field.alias or name for one in models for name, field in one.model_fields.items())
    return list(dict.fromkeys(names))


def _field(model: type[BaseModel], step: str | int) -> Any:
    for name, field in model.model_fields.items():
        if step in (name, field.alias):
            return field.annotation
    return None


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models in an annotation, including those in unions and containers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models(inner)


def _kinds(model: type[BaseModel]) -> Iterable[Any]:
    for field in model.model_fields.values():
        if get_origin(field.annotation) is Literal:
            yield from get_args(field.annotation)
