"""The text of a TOML file for some settings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def toml_text(settings: Mapping[str, Any]) -> str:
    """Return settings as TOML, one line for each, without those that are None, which TOML lacks.

    Values are texts, numbers, booleans and lists of these; names must not need quotes.
    """
    lines = (f"{name} = {_value(value)}\n" for name, value in settings.items() if value is not None)
    return "".join(lines)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        # JSON's escapes are valid in TOML, but DEL must be escaped in TOML and not in JSON.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    raise TypeError(f"no setting of a file: {value!r}")
