"""Detections as lists of tables by name: supervision's JSON, and JSON lines.

A box is an object with the names of the CSV format, in any of their spellings (``x_min y_min x_max
y_max confidence class_id tracker_id``, ...), or with ``box`` or ``bbox`` as a table of these
(``{"x1": ..}``, as Ultralytics has it). An object may also be an image with a list ``detections``
(or ``boxes``, ``objects``, ``predictions``) of boxes; in answers of Roboflow, ``x`` and ``y`` of
its ``predictions`` are centers. Pixels count as in the CSV format. JSON
lines, an object in each line, may also be those of COCO, with a list ``bbox`` of x, y, width,
height.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io.detections.coco import coco_table
from dqslam.io.detections.columns import (
    CENTERS,
    CORNERS,
    MEANING,
    corners_of,
    counted_from_corner,
    edges_of,
    known_columns,
    plain,
)
from dqslam.io.detections.csv import CORNER
from dqslam.io.detections.json_list import Entry, parse_entries, parse_lines
from dqslam.io.detections.other_classes import class_columns
from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, read_text
from dqslam.io.formats import Format, Look, ReadContext

NESTED = ("box", "bbox", "xyxy")
LISTS = ("detections", "boxes", "objects", "predictions")  #: of an image's boxes
ROBOFLOW = "predictions"  #: beside a table "image"; its x and y are centers
_OF_CENTER = {"x": "cx", "y": "cy"}


def read_flat(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read a JSON list of boxes, unchecked."""
    entries, _ = parse_entries(path, read_text(path), "detections")
    return flat_table(path, "supervision", entries, context)


def read_lines(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read JSON lines, unchecked."""
    entries = parse_lines(path, read_text(path))
    if isinstance(entries[0].fields.get("bbox"), list) and "image_id" in entries[0].fields:
        return coco_table(path, "jsonl", entries, {}, context)
    return flat_table(path, "jsonl", entries, context)


def flat_table(
    path: str | Path, format_name: str, entries: Sequence[Entry], context: ReadContext
) -> DetectionTable:
    """Make a table of objects with the names of the CSV format."""
    entries = [_flattened(box) for entry in entries for box in _boxes_of(entry)]
    if not entries:
        raise FileError(path, "holds no boxes")
    keys = dict.fromkeys(key for entry in entries for key in entry.fields)
    names = known_columns(path, keys, context.notes)
    edges = edges_of(path, names, context.notes)
    missing = [name for name in edges if name not in names]
    if not {"frame", "timestamp", "image"} & set(names):
        missing.insert(0, "frame, timestamp or image")
    if missing:
        raise entries[0].error(f"missing {', '.join(missing)} (it has: {', '.join(keys)})")
    spelled = [names[name] for name in edges]
    box = np.array([[entry.number(name) for name in spelled] for entry in entries])
    box = corners_of(box, edges)

    def labels(name: str) -> list[str] | None:
        return [entry.label(names[name]) for entry in entries] if name in names else None

    def numbers(name: str, default: float | None) -> Floats | None:
        if name not in names:
            return None
        return np.array([entry.number(names[name], default) for entry in entries])

    def scores(name: str) -> Floats:
        return np.array([entry.number(names[name], np.nan) for entry in entries])

    frame: Ints | None = None
    if "frame" in names:
        frame = np.array([entry.integer(names["frame"]) for entry in entries], dtype=np.int64)
    records = Records(
        columns=tuple(keys),
        line=[entry.line for entry in entries],
        box=box - CORNER if counted_from_corner(spelled) else box,
        frame=frame,
        image=labels("image"),
        time=numbers("timestamp", None),
        score=numbers("score", NO_SCORE),
        class_id=labels("class_id"),
        class_name=labels("class_name"),
        track_id=labels("track_id"),
        others=class_columns(path, names, labels, scores),
    )
    return make_table(path, format_name, records, context)


def _boxes_of(entry: Entry) -> list[Entry]:
    """Return an entry, or, if it is an image with a list of boxes, its boxes with its fields."""
    key = next((key for key in LISTS if isinstance(entry.fields.get(key), list)), None)
    if key is None:
        return [entry]
    boxes = entry.fields[key]
    if not all(isinstance(box, dict) for box in boxes):
        raise entry.error(f"{key} is no list of tables of named values")
    common = {name: value for name, value in entry.fields.items() if name != key}
    if key == ROBOFLOW and isinstance(common.get("image"), dict):
        common.pop("image")
        common.pop("time", None)  # that the prediction took
        boxes = [{_OF_CENTER.get(name, name): one for name, one in box.items()} for box in boxes]
    return [Entry(entry.path, entry.index, entry.line, common | box) for box in boxes]


def _flattened(entry: Entry) -> Entry:
    """Return an entry whose nested box is among its fields, as box.x1 and so on."""
    fields: dict[str, Any] = {}
    for key, value in entry.fields.items():
        if key in NESTED and isinstance(value, dict):
            fields |= {f"{key}.{name}": one for name, one in value.items()}
        elif key in NESTED and isinstance(value, list):
            if key != "xyxy" or len(value) != 4:
                raise entry.error(f"{key} is a list: are these corners or sizes? name them")
            fields |= {f"box.{name}": one for name, one in zip(CORNERS, value, strict=True)}
        elif key in ("segments", "keypoints", "mask"):
            continue
        else:
            # supervision writes all values as texts.
            fields[key] = _number(value) if MEANING.get(plain(key)) in _NUMBERS else value
    return Entry(entry.path, entry.index, entry.line, fields)


_NUMBERS = {*CORNERS, *CENTERS, "score", "timestamp", "frame"}


def _number(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    if not value.strip():
        return None
    try:
        return float(value)
    except ValueError:
        return value


def _times(entries: Sequence[Entry]) -> bool:
    return bool(entries) and any(
        MEANING.get(plain(key)) == "timestamp" for key in entries[0].fields
    )


def _looks_flat(look: Look) -> bool:
    if look.suffix != ".json":
        return False
    start = look.head.partition("}")[0]  # the first box, or what is before its nested box
    names = {MEANING.get(plain(part)) for part in start.split('"')[1::2]}
    placed = {"x1", "y1"} <= names or {"cx", "cy"} <= names or f'"{ROBOFLOW}"' in look.head
    return placed and '"image_id"' not in start


SUPERVISION = Format(
    "supervision",
    "JSON, a list of boxes with x_min and y_min (or xmin, x1, box.x1, ...)",
    _looks_flat,
    read_flat,
    needs_times=False,
    has_times=lambda path: _times(parse_entries(path, read_text(path), "detections")[0]),
)
JSON_LINES = Format(
    "jsonl",
    "its name ends in .jsonl or .ndjson, or each line is {...}",
    lambda look: (
        look.suffix in (".jsonl", ".ndjson")
        or (look.first.startswith("{") and look.first.endswith("}") and look.second[:1] == "{")
    ),
    read_lines,
    needs_times=False,
    has_times=lambda path: _times(parse_lines(path, read_text(path))),
)
