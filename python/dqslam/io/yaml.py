"""YAML with errors that name the file and the line, by PyYAML: pip install 'dqslam[yaml]'."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam.io.files import FileError

DEEPEST = 100  #: levels of nesting
MOST_CHARACTERS = 10_000_000  #: PyYAML reads about a million in a second


def parse_yaml(path: str | Path, text: str) -> dict[str, Any]:
    """Read a table of named values; only plain data, no objects and no aliases.

    An alias repeats what stands elsewhere, and aliases of aliases make a small file endless.
    """
    try:
        import yaml
    except ImportError:
        message = f"{path}: YAML is read with PyYAML, which is missing: pip install 'dqslam[yaml]'"
        raise RuntimeError(message) from None
    if len(text) > MOST_CHARACTERS:
        raise FileError(path, f"has more than {MOST_CHARACTERS} characters")
    # OpenCV starts its files with %YAML:1.0, which is not YAML; `rostopic echo` ends with ---.
    text = text.replace("%YAML:1.0", "---", 1)
    depth = 0
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            line = event.start_mark.line + 1
            if isinstance(event, yaml.AliasEvent):
                raise FileError(path, f"has an alias, *{event.anchor[:40]}: not read", line)
            if depth > DEEPEST:  # PyYAML's time grows with its square
                raise FileError(path, "nested too deeply", line)
            if isinstance(event, yaml.DocumentEndEvent):
                break
        table = next(iter(yaml.safe_load_all(text)), None)
    except yaml.MarkedYAMLError as error:
        line = None if error.problem_mark is None else error.problem_mark.line + 1
        raise FileError(path, f"not YAML: {error.problem}", line) from None
    except yaml.YAMLError as error:
        raise FileError(path, f"not YAML: {error}") from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError) as error:
        # What the constructors of scalars raise for !!bool x, !!int x, 2024-99-99 and the like.
        if isinstance(error, FileError):
            raise
        raise FileError(path, f"not YAML: a value cannot be read ({str(error)[:80]})") from None
    if not isinstance(table, dict):
        raise FileError(path, "holds no table of named values")
    return table
