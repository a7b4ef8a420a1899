"""The names of columns and keys of boxes: what is read under which name."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

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
CORNERS = ("x1", "y1", "x2", "y2")
SIZES = ("x1", "y1", "width", "height")


def counted_from_corner(names: Iterable[str]) -> bool:
    """Return whether edges of these names count pixels from the corner of the image.

    ``x1 y1 x2 y2`` are this package's own and count from the center of the first pixel. Under any
    other name they come from another program, and those count from the corner.
    """
    return not set(names) <= set(CORNERS)


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
        meaning = MEANING.get(key)
        if meaning is None:
            if key not in SILENT:
                unknown.append(name)
        elif meaning not in found:
            found[meaning] = name
        elif meaning == "track_id" and "id" in (key, plain(found[meaning])):
            found[meaning] = name if plain(found[meaning]) == "id" else found[meaning]
        else:
            message = f"columns {found[meaning]} and {name} are both the {meaning}"
            raise FileError(path, message, line)
    if unknown:
        notes.doubt(path, f"not used: {', '.join(unknown[:12])}" + (", ..." * (len(unknown) > 12)))
    return found
