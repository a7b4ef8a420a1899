"""YAML with errors that name the file and the line, by PyYAML: pip install 'dqslam[yaml]'."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from dqslam.io.files import FileError

# OpenCV's first line is no directive of YAML, and a second document may follow it, or none.
_OPENCV_HEADER = re.compile(r"\A%YAML:[\d.]+[^\n]*")
_OPENCV_TAGS = "tag:yaml.org,2002:opencv-"


def parse_yaml(path: str | Path, text: str) -> dict[str, Any]:
    """Read a table of named values; only plain data, no objects.

    OpenCV's files are read, too: its matrices are tables with ``rows``, ``cols`` and ``data``.
    """
    try:
        import yaml
    except ImportError:
        message = f"{path}: YAML is read with PyYAML, which is missing: pip install 'dqslam[yaml]'"
        raise RuntimeError(message) from None

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        """Plain data, and OpenCV's tags."""

    Loader.add_multi_constructor(
        _OPENCV_TAGS, lambda loader, _, node: loader.construct_mapping(node, deep=True)
    )
    try:
        # `rostopic echo` ends with ---, so that an empty document may follow.
        documents = yaml.load_all(_OPENCV_HEADER.sub("", text), Loader)
        table = next((one for one in documents if one is not None), None)
    except yaml.MarkedYAMLError as error:
        line = None if error.problem_mark is None else error.problem_mark.line + 1
        raise FileError(path, f"not YAML: {error.problem}", line) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    except (yaml.YAMLError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        # Dates that are none, keys that are lists, and the like fail in the constructors.
        raise FileError(path, f"not YAML: {error}") from None
    if not isinstance(table, dict):
        raise FileError(path, "holds no table of named values")
    return table
