"""What a camera file looks like: the language by its ending, or by its beginning without one."""

from __future__ import annotations

import re

from dqslam.io.formats import Look

# The first line of a table in YAML; lines of KITTI's calibration have numbers after a colon, too.
_YAML = re.compile(r"(%YAML:.*|---|[A-Za-z][\w.]*\s*:(\s.*)?)")
_KITTI = re.compile(r"(P\d|[A-Z]_(rect_)?\d\d|calib_time|Tr\w*|R0_rect|R_rect)\s*:")
_TOML = re.compile(r"(\[[\w.\"-]+\]|[\w.-]+\s*=.*)")


def is_yaml(look: Look) -> bool:
    """Return whether a file is YAML."""
    if look.suffix:
        return look.suffix in (".yaml", ".yml")
    return bool(_YAML.fullmatch(look.first)) and not _KITTI.match(look.first)


def is_xml(look: Look) -> bool:
    """Return whether a file is XML."""
    return look.suffix == ".xml" if look.suffix else look.first.startswith("<")


def is_toml(look: Look) -> bool:
    """Return whether a file is TOML."""
    return look.suffix == ".toml" if look.suffix else bool(_TOML.fullmatch(look.first))
