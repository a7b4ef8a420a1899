"""Detections as COCO results: JSON, a list of ``{image_id, category_id, bbox, score}``.

``bbox`` is x, y, width, height in pixels that count from the corner of the image, so that the first
pixel spans 0 to 1. Half a pixel is therefore subtracted from the corners. Without ``bbox`` it is
the box around ``segmentation``. A dataset, ``{images, annotations, categories}``, can be read too.
The frame is the number in the name of the image's file, if there are ``images``, or else in
``image_id``; see `coco_images`. Names of classes are those of ``classes``, else of ``categories``,
else the number. A missing score is 1; it may be named ``confidence`` or ``conf``. Boxes of crowds
(``iscrowd``) are left out.

Entries may have further keys, which we write and which COCO's own tools ignore: ``category_name``,
``timestamp`` [s], ``track_id``. Without ``timestamp`` the times are those of the frames.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dqslam.io.detections.coco_images import coco_images
from dqslam.io.detections.coco_masks import segmentation_box
from dqslam.io.detections.columns import known_columns
from dqslam.io.detections.json_list import Entry, parse_entries
from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import NO_SCORE, DetectionTable
from dqslam.io.files import FileError, read_text, write_text
from dqslam.io.formats import Format, Look, ReadContext

CORNER = 0.5  #: COCO's pixel coordinates minus ours
DIGITS = 6  #: decimals of a written box
# Keys of COCO and of programs that write it, which say nothing more about a box.
IGNORED = {
    *("image_id", "bbox", "bbox_mode", "id", "area", "iscrowd", "ignore", "segmentation"),
    *("keypoints", "num_keypoints", "attributes", "supercategory", "video_id", "license"),
}
XYXY, XYWH = 0, 1  #: values of Detectron2's bbox_mode


def read_coco(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    entries, rest = parse_entries(path, read_text(path), "annotations")
    return coco_table(path, "coco", entries, rest, context)


def coco_table(
    path: str | Path,
    format_name: str,
    entries: Sequence[Entry],
    rest: dict[str, Any],
    context: ReadContext,
) -> DetectionTable:
    """Make a table of COCO's entries and of what is beside them in a dataset."""
    if not entries:
        raise FileError(path, "holds no boxes")
    crowds = sum(bool(entry.fields.get("iscrowd")) for entry in entries)
    context.notes.skip(path, "boxes", "boxes of crowds (iscrowd)", crowds, len(entries))
    entries = [entry for entry in entries if not entry.fields.get("iscrowd")]
    if not entries:
        raise FileError(path, "holds no boxes but those of crowds")
    keys = dict.fromkeys(key for entry in entries for key in entry.fields)
    known = known_columns(path, (key for key in keys if key not in IGNORED), context.notes)
    image_key = next(
        (key for key in ("image_id", known.get("image"), known.get("frame")) if key in keys),
        "image_id",
    )
    images = coco_images(path, entries, rest.get("images"), image_key or "image_id", context)
    timed = known.get("timestamp")
    scored = known.get("score")

    def labels(name: str) -> list[str] | None:
        return [entry.label(known[name]) for entry in entries] if name in known else None

    if "class_id" not in known and "class_name" not in known:
        entries[0].value("category_id")
    records = Records(
        columns=tuple(entries[0].fields),
        line=[entry.line for entry in entries],
        box=np.array([_corners(entry) for entry in entries]) - CORNER,
        frame=images.numbers,
        image=images.names,
        all_images=images.all_names,
        time=None if timed is None else np.array([entry.number(timed) for entry in entries]),
        score=(
            None
            if scored is None
            else np.array([entry.number(scored, NO_SCORE) for entry in entries])
        ),
        class_id=labels("class_id"),
        class_name=labels("class_name"),
        track_id=labels("track_id"),
        class_names=_categories(path, rest.get("categories")),
        image_size=images.size,
    )
    return make_table(path, format_name, records, context)


def _corners(entry: Entry) -> list[float]:
    """Return the corners of a box in COCO's pixels."""
    if "bbox" not in entry.fields and "segmentation" in entry.fields:
        x, y, w, h = segmentation_box(entry)
    else:
        x, y, w, h = entry.numbers("bbox", 4)
    mode = entry.fields.get("bbox_mode", XYWH)
    if mode == XYXY:
        return [x, y, w, h]
    if mode != XYWH:
        raise entry.error(f"bbox_mode is {mode!r}, not {XYXY} (corners) or {XYWH} (x y w h)")
    return [x, y, x + w, y + h]


def write_coco(path: str | Path, table: DetectionTable, *, times: bool = True) -> None:
    """Write boxes to a millionth of a pixel, one per line, with or without their times."""
    corner = table.box + CORNER
    size = corner[:, 2:] - corner[:, :2]
    boxes = np.round(np.hstack([corner[:, :2], size]), DIGITS).tolist()
    lines = []
    for row, box in enumerate(boxes):
        entry = {
            "image_id": int(table.frame[row]),
            "category_id": int(table.class_id[row]),
            "bbox": box,
            "score": round(float(table.score[row]), DIGITS),
            "category_name": table.class_name[row],
        }
        if times:
            entry["timestamp"] = float(table.timestamp[row])
        if table.track_id is not None:
            entry["track_id"] = int(table.track_id[row])
        lines.append(json.dumps(entry, ensure_ascii=False))
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


def has_times(path: str | Path) -> bool:
    """Return whether the entries of a file have times."""
    entries, _ = parse_entries(path, read_text(path), "annotations")
    return bool(entries) and "timestamp" in entries[0].fields


def read_categories(path: str | Path) -> dict[int, str]:
    """Read names of classes from a COCO file that has ``categories``, or is that list."""
    entries, _ = parse_entries(path, read_text(path), "categories")
    return {entry.integer("id"): entry.text("name") for entry in entries}


def _categories(path: str | Path, content: Any) -> dict[str, str]:
    if content is None:
        return {}
    try:
        return {str(item["id"]): str(item["name"]) for item in content}
    except (KeyError, TypeError):
        raise FileError(path, "categories is no list of {id, name}") from None


def _looks(look: Look) -> bool:
    return look.suffix == ".json"


COCO = Format(
    "coco",
    "its name ends in .json",
    _looks,
    read_coco,
    write_coco,
    needs_times=False,
    has_times=has_times,
    endings=(".json",),
)
