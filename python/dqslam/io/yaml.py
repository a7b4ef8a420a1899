"""YAML with errors that name the file and the line, by PyYAML: pip install 'dqslam[yaml]'."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from dqslam.io.files import FileError

DEEPEST = 100  #: levels of nesting
MOST_CHARACTERS = 10_000_000  #: PyYAML reads about a million in a second
# OpenCV's first line is no directive of YAML.
_OPENCV_HEADER = re.compile(r"\A%YAML:[\d.]+[^\n]*")
_OPENCV_TAGS = "tag:yaml.org,2002:opencv-"


def parse_yaml(path: str | Path, text: str) -> dict[str, Any]:
    """Read a table of named values; only plain data, no objects and no aliases.

    An alias repeats what stands elsewhere, and aliases of aliases make a small file endless.
    OpenCV's files are read, too: its matrices are tables with ``rows``, ``cols`` and ``data``.
    """
    try:
        import yaml
    except ImportError:
        message = f"{path}: YAML is read with PyYAML, which is missing: pip install 'dqslam[yaml]'"
        raise RuntimeError(message) from None
    if len(text) > MOST_CHARACTERS:
        raise FileError(path, f"has more than {MOST_CHARACTERS} characters")

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        """Plain data, and OpenCV's tags; a key may be repeated but has one value."""

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            before: dict[Any, Any] = {}
            for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
                if not isinstance(key, yaml.ScalarNode):
                    continue
                if before.setdefault(key.value, value.value) != value.value:
                    line = key.start_mark.line + 1
                    message = f"{str(key.value)[:40]} is there twice, with different values"
                    raise FileError(path, message, line)
            return super().construct_mapping(node, deep=deep)

    Loader.add_multi_constructor(
        _OPENCV_TAGS, lambda loader, _, node: loader.construct_mapping(node, deep=True)
    )
    text = _OPENCV_HEADER.sub("", text)
    try:
        _check_events(path, yaml, text)
        # `rostopic echo` ends with ---, and an empty document may come first.
        documents = yaml.load_all(text, Loader)
        table = next((one for one in documents if one is not None), None)
    except yaml.MarkedYAMLError as error:
        line = None if error.problem_mark is None else error.problem_mark.line + 1
        raise FileError(path, f"not YAML: {error.problem}", line) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    except (yaml.YAMLError, ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise _no_value(path, error) from None
    except ValueError as error:
        if isinstance(error, FileError):
            raise
        raise _no_value(path, error) from None
    if not isinstance(table, dict):
        raise FileError(path, "holds no table of named values")
    return table


def _check_events(path: str | Path, yaml: Any, text: str) -> None:
    """Refuse aliases and deep nesting up to the end of the first document that holds anything."""
    depth, is_empty = 0, True
    for event in yaml.parse(text, yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        is_empty = is_empty and depth == 0
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            raise FileError(path, f"has an alias, *{event.anchor[:40]}: not read", line)
        if depth > DEEPEST:  # PyYAML's time grows with its square
            raise FileError(path, "nested too deeply", line)
        if isinstance(event, yaml.DocumentEndEvent) and not is_empty:
            break


def _no_value(path: str | Path, error: Exception) -> FileError:
    """Return the error of a scalar that is none: !!bool x, !!int x, 2024-99-99 and the like."""
    return FileError(
        path, f"not YAML: a value cannot be read ({' '.join(str(error)[:80].split())})"
    )
