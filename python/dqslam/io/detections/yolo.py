"""Detections as YOLO text: one file per image, one line ``class cx cy w h [score [id]]`` per box.

Center and size are shares of the image's width and height, which must be known. They count from the
corner of the image, so half a pixel is subtracted. Ultralytics also writes ``class cx cy w h id``
(tracks without scores), outlines ``class x1 y1 x2 y2 x3 y3 ... [score [id]]`` (segments, and turned
boxes with 4 corners) and key points ``class cx cy w h x y [visible] ... [score [id]]``; outlines
become the box around them. All lines of a folder have the same form, which all of them tell
together: see `yolo_lines`.

The frame comes from the names of all files, see `dqslam.io.image_names`. Names of classes are those
of ``classes``, else of ``classes.txt`` (one line per class, from 0), else of ``names`` in
``data.yaml``, else the number. Times are those of the frames, or of ``frames.csv`` in the folder,
which we write. A file without a box is an image without boxes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from dqslam._input import plain_name
from dqslam.io.detections.records import Records, make_table
from dqslam.io.detections.table import DetectionTable
from dqslam.io.detections.yolo_lines import YoloLine, split_lines
from dqslam.io.files import FileError, read_text, text_files, whole_folder, write_text
from dqslam.io.formats import Format, Look, ReadContext
from dqslam.io.frames import frame_table, read_frame_times
from dqslam.io.image_names import have_times
from dqslam.io.yaml import parse_yaml

FIELDS = ("class", "cx", "cy", "w", "h", "score", "id")
CORNER = 0.5  #: YOLO's pixel coordinates minus ours
CLASSES, DATA, TIMES = "classes.txt", "data.yaml", "frames.csv"
LARGEST_CLASS = 9999  #: limits classes.txt, which has a line for every number up to the largest


def read_yolo(path: str | Path, context: ReadContext) -> DetectionTable:
    """Read boxes, unchecked."""
    size = context.size
    if size is None:
        message = "yolo's boxes are shares of the image: give its size with --camera"
        raise FileError(path, message)
    folder = Path(path)
    if not folder.is_dir():
        raise FileError(path, "is no folder of .txt files")
    if context.frames is None and (folder / TIMES).is_file():
        context = replace(context, frames=read_frame_times(folder / TIMES))
    lines = _lines(folder, context)
    if not lines:
        raise FileError(folder, "holds no boxes")
    boxes = split_lines(lines, context.notes, folder)
    records = Records(
        columns=FIELDS,
        line=[line.number for line in lines],
        box=boxes.share * np.tile(size, 2) - CORNER,
        image=[plain_name(line.file) for line in lines],
        all_images=[plain_name(file) for file in _box_files(folder)],
        score=boxes.score,
        class_id=[line.cells[0] for line in lines],
        class_names={str(number): name for number, name in _names(folder).items()},
        track_id=boxes.track_id,
        files=[str(line.file) for line in lines],
    )
    return make_table(path, "yolo", records, context)


def write_yolo(
    path: str | Path, table: DetectionTable, *, width: int, height: int, times: bool = True
) -> None:
    """Write a new folder with boxes, classes.txt, and frames.csv with their times."""
    names = dict(zip(table.class_id.tolist(), table.class_name, strict=True))
    if min(names) < 0 or max(names) > LARGEST_CLASS:
        wrong = min(names) if min(names) < 0 else max(names)
        raise FileError(path, f"yolo has no place for class {wrong}, only for 0 to {LARGEST_CLASS}")
    corner = (table.box + CORNER) / np.tile([width, height], 2)
    center, size = (corner[:, :2] + corner[:, 2:]) / 2, corner[:, 2:] - corner[:, :2]
    content: dict[str, list[str]] = {}
    for row, numbers in enumerate(np.hstack([center, size]).tolist()):
        line = f"{table.class_id[row]} " + " ".join(f"{number:.12f}" for number in numbers)
        line += f" {float(table.score[row])!r}"
        if table.track_id is not None:
            line += f" {table.track_id[row]}"
        content.setdefault(f"{table.frame[row]:06d}.txt", []).append(line + "\n")
    content[CLASSES] = [names.get(i, str(i)) + "\n" for i in range(max(names) + 1)]
    if times:
        content[TIMES] = frame_table(table.frame, table.timestamp)
    if Path(path).suffix.lower() == ".gz":
        raise FileError(path, "yolo is a folder of files, which is not packed")
    with whole_folder(path) as folder:
        for name, lines in content.items():
            write_text(folder / name, lines)


def _lines(folder: Path, context: ReadContext) -> list[YoloLine]:
    """Read the lines of all files; a file of blanks is an image without boxes."""
    lines: list[YoloLine] = []
    files = _box_files(folder)
    for done, file in enumerate(files, start=1):
        context.progress(done / len(files))
        text = read_text(file, may_be_blank=True)
        lines += [
            YoloLine(file, number, tuple(row.split()))
            for number, row in enumerate(text.split("\n"), start=1)
            if row.strip() and not row.lstrip().startswith("#")
        ]
    return lines


def _box_files(folder: Path) -> list[Path]:
    return [file for file in text_files(folder) if plain_name(file) != CLASSES]


def _names(folder: Path) -> dict[int, str]:
    if (folder / CLASSES).is_file():
        lines = read_text(folder / CLASSES).rstrip("\n").split("\n")
        return {i: line.strip() for i, line in enumerate(lines) if line.strip()}
    if (folder / DATA).is_file():
        return read_data_names(folder / DATA)
    return {}


def read_data_names(path: str | Path) -> dict[int, str]:
    """Read ``names`` of a data.yaml: a list, or a table by number."""
    names = parse_yaml(path, read_text(path)).get("names")
    if isinstance(names, list):
        names = dict(enumerate(names))
    if not isinstance(names, dict) or not all(isinstance(key, int) for key in names):
        raise FileError(path, "names is no list, and no table by number")
    return {key: str(name) for key, name in names.items()}


def _looks(look: Look) -> bool:
    return look.path.is_dir() and bool(_box_files(look.path))


def _has_times(path: Path) -> bool:
    return (path / TIMES).is_file() or have_times([plain_name(file) for file in _box_files(path)])


YOLO = Format(
    "yolo",
    "a folder of .txt files",
    _looks,
    read_yolo,
    write_yolo,
    needs_times=False,
    has_times=_has_times,
    endings=("",),
)
