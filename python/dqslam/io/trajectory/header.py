"""Headers of trajectories: the names of columns, in a comment or in the first row.

A header that names the four parts of a quaternion is believed: it says which column is which, and
units in brackets. A comment may have other words around these names, as in "format: t tx ty tz qx
qy qz qw (m, s)". A comment that only says that w is first, "wxyz", is believed, too. Any other
comment is prose.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dqslam.io.files import FileError

FIELDS = ("t", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
# In lower case, without what is in brackets, "_" for all but letters and digits.
SPELLINGS = {
    "t": ("t", "time", "timestamp", "stamp", "timestamps", "timestamp_s", "time_s", "sec"),
    "qx": ("qx", "q_x", "q_rs_x", "rot_x", "quat_x", "orientation_x", "pose_orientation_x"),
    "tx": ("tx", "t_x", "x", "px", "p_x", "p_rs_r_x", "pos_x", "position_x", "pose_position_x"),
}
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "": 1.0}
# Names of ends of times, which are not in brackets.
TIME_UNITS = {"_ns": "ns", "_us": "us", "_ms": "ms", "_nsec": "ns"}
FIELDS_W_FIRST = ("t", "tx", "ty", "tz", "qw", "qx", "qy", "qz")
W_FIRST = re.compile(r"(?i)\bw ?,? ?x ?,? ?y ?,? ?z\b|\bw[- ]first\b")
QUATERNION = {"qx", "qy", "qz", "qw"}
# A header that has these instead of a quaternion is one as well: the error says what is missing.
ANGLES = {"roll", "pitch", "yaw", "theta", "heading", "rx", "ry", "rz", "phi", "psi"}


def split_row(row: str) -> list[str]:
    """Split a line at commas, semicolons or tabs, or else at spaces."""
    separator = next((one for one in (",", ";", "\t") if one in row), None)
    return (
        [cell.strip() for cell in row.split(separator)] if separator in (",", ";") else row.split()
    )


@dataclass(frozen=True)
class Header:
    """Which column has which of FIELDS, and what its unit is in s or m."""

    columns: dict[str, int]
    units: dict[str, str]
    count: int  #: number of columns
    others: tuple[str, ...]  #: names that mean nothing here
    angles: tuple[str, ...] = ()  #: those of them that are angles, without a quaternion beside them
    words: bool = False  #: whether these may be words after the names, and no columns


def _meanings() -> dict[str, str]:
    found = {name: "t" for name in SPELLINGS["t"]}
    for kind, axes in (("qx", "xyzw"), ("tx", "xyz")):
        for axis in axes:
            for name in SPELLINGS[kind]:
                found[re.sub("x$", axis, name)] = kind[0] + axis
    return found


MEANING = _meanings()
# Tables of ROS messages have the path of a field for its name: field.pose.pose.orientation.x.
MESSAGE = re.compile(r".*_(position|orientation)_([xyzw])")


def _meaning(bare: str) -> str | None:
    """Return which of FIELDS a name is, in lower case and with _ between its parts."""
    field = MESSAGE.fullmatch(bare)
    if bare not in MEANING and field is not None:
        return ("t" if field[1] == "position" else "q") + field[2]
    return MEANING.get(bare)


def parse_header(text: str) -> Header | None:
    """Return the header that a comment or row is, or None if it is none.

    It may be separated by commas, semicolons, or spaces. It names a quaternion, or angles.
    """
    text = text.strip().lstrip("#%/").strip()
    # There are at least seven names, and a word or two may have commas.
    separator = next((one for one in (",", ";", "\t") if text.count(one) >= 6), None)
    # A unit may be apart from its name: "p_RS_R_x [m]".
    names = text.split(separator) if separator else re.sub(r"\s+[\[(]", "[", text).split()
    columns: dict[str, int] = {}
    units: dict[str, str] = {}
    others: list[str] = []
    angles: list[str] = []
    for place, name in enumerate(names):
        bare = re.sub(r"[^a-z0-9]+", "_", re.sub(r"[\[(].*", "", name.strip().lower())).strip("_")
        unit = re.search(r"[\[(]\s*([a-z]*)\s*[\])]", name.strip().lower())
        given = unit[1] if unit else ""
        for ending, ending_unit in TIME_UNITS.items():
            if bare.endswith(ending) and bare.removesuffix(ending) in SPELLINGS["t"]:
                bare, given = bare.removesuffix(ending), ending_unit
        meaning = _meaning(bare)
        if meaning is None or meaning in columns:
            others.append(name.strip())
            if bare.split("_")[0] in ANGLES:
                angles.append(name.strip())
        else:
            columns[meaning], units[meaning] = place, given
    if len(QUATERNION & set(columns)) < len(QUATERNION):
        if not angles or not {"t", "tx", "ty"} <= set(columns):
            return None
        return Header(columns, units, len(names), tuple(others), tuple(angles))
    return Header(columns, units, len(names), tuple(others))


def find_header(comments: Sequence[str], first: str) -> Header | None:
    """Return the header in the first row, or else in the last comment that is one."""
    header = parse_header(first)
    if header is not None:
        return header
    for text in reversed(comments):
        header = parse_header(text)
        if header is not None and (not header.angles or len(split_row(first)) == header.count):
            return _without_words(header)
    if any(W_FIRST.search(text) for text in comments):
        columns = dict(zip(FIELDS_W_FIRST, range(len(FIELDS)), strict=True))
        return Header(columns, {}, len(FIELDS), ())
    return None


def _without_words(header: Header) -> Header:
    """Return the header of a comment without the words before its names.

    Words after them may be names of columns, or not.
    """
    places = sorted(header.columns.values())
    if len(header.columns) < len(FIELDS) or places[-1] - places[0] >= len(FIELDS):
        return header
    columns = {name: place - places[0] for name, place in header.columns.items()}
    after = header.others[places[0] :]
    return Header(columns, header.units, len(FIELDS) + len(after), after, words=bool(after))


def unit_of(path: str | Path, header: Header, name: str) -> float:
    """Return the unit of a column in s or m.

    Raises
    ------
    FileError
        If the header names a unit that is not known.
    """
    unit = header.units.get(name, "")
    if unit not in UNITS:
        raise FileError(path, f"the header gives {name} in {unit}, not one of {', '.join(UNITS)}")
    return UNITS[unit]
