"""YAML with errors that name the file and the line, by PyYAML: pip install 'dqslam[yaml]'."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam.io.files import FileError


def parse_yaml(path: str | Path, text: str) -> dict[str, Any]:
    """Read a table of named values; only plain data, no objects."""
    try:
        import yaml
    except ImportError:
        message = f"{path}: YAML is read with PyYAML, which is missing: pip install 'dqslam[yaml]'"
        raise RuntimeError(message) from None
    # OpenCV starts its files with %YAML:1.0, which is not YAML; `rostopic echo` ends with ---.
    try:
        table = next(iter(yaml.safe_load_all(text.replace("%YAML:1.0", "---", 1))), None)
    except yaml.MarkedYAMLError as error:
        line = None if error.problem_mark is None else error.problem_mark.line + 1
        raise FileError(path, f"not YAML: {error.problem}", line) from None
    except yaml.YAMLError as error:
        raise FileError(path, f"not YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    if not isinstance(table, dict):
        raise FileError(path, "holds no table of named values")
    return table
