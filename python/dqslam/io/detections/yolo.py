"""Detections as YOLO text: one file per image, one line ``class cx cy w h [score [id]]`` per box.

Center and size are shares of the image's width and height, which must be known. They count from the
corner of the image, so half a pixel is subtracted. The frame comes from the name of the file, see
`dqslam.io.frames.frame_of`. Names of classes are those of ``classes``, else of ``classes.txt`` (one
line per class, from 0), else of ``names`` in ``data.yaml``, else the number. Times are those of the
frames, or of ``frames.csv`` in the folder, which we write.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam.io.detections.table import NO_SCORE, NO_TRACK, DetectionTable
from dqslam.io.files import (
    FileError,
    parse_integers,
    parse_numbers,
    read_rows,
    read_text,
    whole_folder,
    write_text,
)
from dqslam.io.formats import Format, Look, Progress, no_progress
from dqslam.io.frames import FrameTimes, frame_of, frame_table, read_frame_times
from dqslam.io.yaml import parse_yaml

FIELDS = ("class", "cx", "cy", "w", "h", "score", "id")
CORNER = 0.5  #: YOLO's pixel coordinates minus ours
CLASSES, DATA, TIMES = "classes.txt", "data.yaml", "frames.csv"
LARGEST_CLASS = 9999  #: limits classes.txt, which has a line for every number up to the largest


def read_yolo(
    path: str | Path,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
    progress: Progress = no_progress,
) -> DetectionTable:
    """Read boxes, unchecked, in images of width x height px."""
    if width is None or height is None:
        raise FileError(path, "yolo's boxes are shares of the image: give its size with --camera")
    folder = Path(path)
    if not folder.is_dir():
        raise FileError(path, "is no folder of .txt files")
    if frames is None and (folder / TIMES).is_file():
        frames = read_frame_times(folder / TIMES)
    if frames is None:
        message = "yolo has no times: give them with --frame-times FILE or --frame-rate HZ"
        raise FileError(path, message)
    rows, lines, files, frame = _read_rows(folder, frames, progress)
    columns = dict(zip(FIELDS, zip(*rows, strict=True), strict=True))

    def numbers(name: str) -> list[float]:
        # Files are checked one after the other, so that an error names the right one.
        return [
            float(parse_numbers(file, name, [cell], [line])[0])
            for file, cell, line in zip(files, columns[name], lines, strict=True)
        ]

    def integers(name: str) -> list[int]:
        return [
            int(parse_integers(file, name, [cell], [line])[0])
            for file, cell, line in zip(files, columns[name], lines, strict=True)
        ]

    cx, cy, w, h = (np.array(numbers(name)) for name in FIELDS[1:5])
    share = np.column_stack([cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2])
    class_id = integers("class")
    names = _names(folder) | (classes or {})
    times = [
        frames.at(file, np.array([number]), [line])[0]
        for file, number, line in zip(files, frame, lines, strict=True)
    ]
    track = np.array(integers("id"), dtype=np.int64)
    return DetectionTable(
        path=str(path),
        columns=FIELDS,
        line=np.array(lines),
        frame=np.array(frame, dtype=np.int64),
        timestamp=np.array(times),
        box=share * np.tile([width, height], 2) - CORNER,
        score=np.array(numbers("score")),
        class_id=np.array(class_id, dtype=np.int64),
        class_name=tuple(names.get(number, str(number)) for number in class_id),
        track_id=track if (track != NO_TRACK).any() else None,
        files=tuple(map(str, files)),
    )


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
    with whole_folder(path) as folder:
        for name, lines in content.items():
            write_text(folder / name, lines)


def _read_rows(
    folder: Path, frames: FrameTimes, progress: Progress
) -> tuple[list[list[str]], list[int], list[Path], list[int]]:
    """Read all boxes as seven cells, with the line, the file and the frame of each."""
    rows: list[list[str]] = []
    lines, files, numbers = [], [], []
    box_files = _box_files(folder)
    for done, file in enumerate(box_files, start=1):
        progress(done / len(box_files))
        if not file.stat().st_size:
            continue  # an image without boxes has an empty file
        number = frame_of(file.name, frames)
        if number is None:
            raise FileError(file, "its name is no number of a frame, and in no --frame-times")
        for row, line in zip(*read_rows(file), strict=True):
            cells = row.split()
            if not 5 <= len(cells) <= len(FIELDS):
                raise FileError(file, f"{len(cells)} fields, not 5 to 7: {' '.join(FIELDS)}", line)
            rows.append(cells + [str(NO_SCORE), str(NO_TRACK)][len(cells) - 5 :])
            lines.append(line)
            files.append(file)
            numbers.append(number)
    if not rows:
        raise FileError(folder, "holds no boxes")
    return rows, lines, files, numbers


def _box_files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.glob("*.txt") if file.name != CLASSES)


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


YOLO = Format(
    "yolo",
    "a folder of .txt files",
    _looks,
    read_yolo,
    write_yolo,
    needs_times=False,
    has_times=lambda path: (path / TIMES).is_file(),
    endings=("",),
    tells_share=True,
)
