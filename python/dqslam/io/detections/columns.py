"""The names of columns and keys of boxes: what is read under which name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam.io.detections.other_classes import NUMBERED
from dqslam.io.files import FileError
from dqslam.io.notes import Notes

# Names as detectors, trackers and tables of pandas have them; in lower case, "_" for anything else.
# (In the columns of Ultralytics' tables of results, box.x1 is box_x1.)
SPELLINGS: dict[str, tuple[str, ...]] = {
    "frame": ("frame", "frame_id", "frame_index", "frame_number", "frame_no", "frame_idx"),
    "image": ("image", "image_name", "image_path", "file_name", "filename", "file", "path"),
    "timestamp": ("timestamp", "time", "t", "timestamp_s", "time_s", "stamp"),
    "x1": ("x1", "xmin", "x_min", "left", "box_x1", "bbox_x1", "bb_left"),
    "y1": ("y1", "ymin", "y_min", "top", "box_y1", "bbox_y1", "bb_top"),
    "x2": ("x2", "xmax", "x_max", "right", "box_x2", "bbox_x2"),
    "y2": ("y2", "ymax", "y_max", "bottom", "box_y2", "bbox_y2"),
    "cx": ("cx", "center_x", "x_center", "xcenter", "centre_x", "bbox_cx", "xc"),
    "cy": ("cy", "center_y", "y_center", "ycenter", "centre_y", "bbox_cy", "yc"),
    "width": ("width", "w", "bb_width", "bbox_width"),
    "height": ("height", "h", "bb_height", "bbox_height"),
    "score": ("score", "confidence", "conf", "probability", "prob"),
    "class_id": ("class_id", "class", "cls", "category_id", "label_id", "class_index"),
    "class_name": ("class_name", "name", "label", "category", "category_name", "cls_name"),
    "track_id": ("track_id", "tracker_id", "object_id", "track", "id", "tracking_id"),
}
MEANING = {spelling: name for name, all_of in SPELLINGS.items() for spelling in all_of}
# An index of pandas has no name. The others repeat what the box says, or belong to our results.
SILENT = {"", "unnamed_0", "index", "area"}
FIRST_OTHER = 2  #: number at the end of the columns of the second class of a box
CORNERS = ("x1", "y1", "x2", "y2")
SIZES = ("x1", "y1", "width", "height")
CENTERS = ("cx", "cy", "width", "height")


def edges_of(path: str | Path, names: Mapping[str, str], notes: Notes) -> tuple[str, ...]:
    """Return which four of the known columns are the box: corners, corner and size, or center.

    ``x`` and ``y`` beside a size are taken for the corner, which is noted.
    """
    if {"x2", "y2"} & set(names) or "width" not in names:
        return CORNERS
    if {"cx", "cy"} & set(names):
        return CENTERS
    if plain(names.get("x1", "")) == "x":
        notes.doubt(
            path, "x and y are taken for the corner of a box: --box-form cxcywh if its center"
        )
    return SIZES


def corners_of(numbers: Floats, edges: Sequence[str]) -> Floats:
    """Return corners (m, 4) from the numbers of these four columns (m, 4)."""
    first, second = numbers[:, :2], numbers[:, 2:]
    if edges == CENTERS:
        return np.hstack([first - second / 2, first + second / 2])
    return np.hstack([first, first + second]) if edges == SIZES else numbers


def counted_from_corner(names: Iterable[str]) -> bool:
    """Return whether edges of these names count pixels from the corner of the image.

    ``x1 y1 x2 y2`` are this package's own and count from the center of the first pixel. Under any
    other name they come from another program, and those count from the corner.
    """
    return not set(names) <= set(CORNERS)


def _numbered(key: str) -> str | None:
    """Return the meaning of a column of another class of the boxes, such as ``class_id_2``."""
    name, _, number = key.rpartition("_")
    meaning = MEANING.get(name)
    another = number.isdecimal() and int(number) >= FIRST_OTHER
    return f"{meaning}_{int(number)}" if another and meaning in NUMBERED else None


def plain(name: str) -> str:
    """Return a name in lower case with "_" for spaces, points and signs."""
    return re.sub(r"[^a-z0-9]+", "_", name.strip().lower()).strip("_")


def known_columns(
    path: str | Path, names: Iterable[str], notes: Notes, line: int | None = None
) -> dict[str, str]:
    """Return the name in the file of each column that is known; others are noted.

    An exact name goes before another spelling only where the other has its own meaning: a file with
    both ``track_id`` and ``id`` has the number of the row under ``id``.

    Raises
    ------
    FileError
        If two columns mean the same.
    """
    found: dict[str, str] = {}
    unknown = []
    for name in names:
        key = plain(name)
        meaning = MEANING.get(key) or _numbered(key)
        if meaning is None:
            if key not in SILENT:
                unknown.append(name)
        elif meaning not in found:
            found[meaning] = name
        elif meaning == "class_id" and "class" in (key, plain(found[meaning])):
            # Beside an id, "class" is the name, as Roboflow has it.
            label = name if key == "class" else found[meaning]
            if "class_name" in found:
                raise FileError(
                    path, f"columns {label} and {found['class_name']} are both a name", line
                )
            found["class_id"] = found[meaning] if key == "class" else name
            found["class_name"] = label
        elif meaning == "track_id" and "id" in (key, plain(found[meaning])):
            found[meaning] = name if plain(found[meaning]) == "id" else found[meaning]
        else:
            message = f"columns {found[meaning]} and {name} are both the {meaning}"
            raise FileError(path, message, line)
    # x and y alone may be of anything, beside a size and no other place they are of the box.
    if {"width", "height"} <= set(found) and not {"x1", "y1", "cx", "cy"} & set(found):
        found |= {f"{plain(name)}1": name for name in unknown if plain(name) in ("x", "y")}
        unknown = [name for name in unknown if plain(name) not in ("x", "y")]
    if unknown:
        notes.doubt(path, f"not used: {', '.join(unknown[:12])}" + (", ..." * (len(unknown) > 12)))
    return found
