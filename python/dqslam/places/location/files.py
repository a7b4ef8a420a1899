"""Where the camera of some images is in a map, from files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam import io as files
from dqslam.io import FileError, Notes, ReadOptions
from dqslam.io.files import write_text
from dqslam.io.recording import class_names_of, more_of_boxes
from dqslam.lens import undistorted_or_nan
from dqslam.places.location.location import Location, locate, place_of
from dqslam.recording import Detections

TABLE = "locations.csv"
_COLUMNS = ("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw", "confidence")


@dataclass(frozen=True, eq=False)
class ImageLocation:
    """The answer for an image."""

    timestamp: float
    """Of the image, seconds."""
    boxes: int
    """Number of boxes that it is from."""
    location: Location


def locate_files(
    known: str | Path,
    camera: str | Path,
    detections: str | Path,
    odometry: str | Path | None = None,
    *,
    min_score: float = 0.3,
    min_confidence: float = 0.9,
    reading: ReadOptions | None = None,
    notes: Notes | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> list[ImageLocation]:
    """Locate each image of a file of boxes, or, with odometry between them, all together.

    Parameters
    ----------
    known
        Folder of results: the map.
    camera, detections, odometry
        Files in any format that ``load_recording`` reads.
    min_score
        Boxes with a lower score are left out.
    reading, notes
        As in ``load_recording``.

    Raises
    ------
    FileError
        If a file is missing or wrong, or has no box.
    ValueError
        If a setting is out of its range, or the map has no ellipsoid.
    """
    if not 0.0 <= min_score <= 1.0:
        raise ValueError(f"min_score is {min_score:g}, not between 0 and 1")
    place = place_of(known)
    how = reading or ReadOptions()
    if odometry is not None:
        recording, _ = files.load_recording(
            camera,
            odometry,
            detections,
            ids="none",
            min_score=min_score,
            reading=how,
            notes=notes,
        )
        motion = recording.odometry
        poses = _core.dead_reckon(motion.pose_model, motion.first_pose, motion.relative)
        found = locate(
            place,
            recording.detections,
            recording.camera,
            odometry=_core.world_from_camera(motion.pose_model, recording.camera, poses),
            min_confidence=min_confidence,
        )
        time = float(recording.timestamps[found.image])
        return [ImageLocation(time, len(recording.detections), found)]
    lens = files.read_camera_file(camera, how)
    times, boxes = _read_images(lens, detections, how, notes, min_score)
    answers = []
    for image, time in enumerate(times.tolist()):
        own = boxes.select(boxes.pose == image)
        found = locate(place, own, lens, min_confidence=min_confidence)
        answers.append(ImageLocation(time, len(own), found))
        progress((image + 1) / len(times))
    return answers


def _read_images(
    lens: _core.Camera,
    path: str | Path,
    how: ReadOptions,
    notes: Notes | None,
    min_score: float,
) -> tuple[np.ndarray, Detections]:
    """Read the boxes of a file, whose poses are the numbers of images, and the images' times."""
    boxes = how.readings.boxes if how.readings.changes_boxes else None
    size = (lens.width, lens.height)
    table = files.read_detections(
        path,
        how.formats.detections,
        width=lens.width,
        height=lens.height,
        frames=how.frames,
        first_frame=how.first_frame,
        reread=None if boxes is None else partial(boxes.read, size=size),
        min_score=min_score,
        nms=how.nms,
        notes=notes,
    )
    table = how.span.of_boxes(table)
    box = undistorted_or_nan(lens, table.box) if lens.has_distortion else table.box
    keep = (table.score >= min_score) & np.isfinite(box).all(axis=1)
    if not keep.any():
        raise FileError(path, f"none of {len(table)} boxes has a score of at least {min_score:g}")
    times, image = np.unique(table.timestamp[keep], return_inverse=True)
    detections = Detections(
        pose=image.reshape(-1),
        box=box[keep],
        score=table.score[keep],
        class_id=table.class_id[keep],
        object_id=np.full(int(keep.sum()), -1),
        class_names=class_names_of(table),
        **more_of_boxes(table, np.flatnonzero(keep)),
    )
    return times, detections


def write_locations(folder: Path, answers: list[ImageLocation]) -> None:
    """Write ``locations.csv`` and ``locations.json`` into a folder."""
    lines = [",".join((*_COLUMNS, "reason"))]
    for one in answers:
        found = one.location
        pose = found.pose if found.is_found else np.full(7, np.nan)
        cells = [f"{one.timestamp:.9f}", *(f"{x:.9g}" if np.isfinite(x) else "" for x in pose)]
        reason = found.reason.replace('"', "'")
        lines.append(",".join([*cells, f"{found.confidence:.6f}", f'"{reason}"']))
    write_text(folder / TABLE, "\n".join(lines) + "\n")
    files.write_json(folder / "locations.json", {"images": [described(one) for one in answers]})


def described(answer: ImageLocation) -> dict[str, object]:
    """Return an answer as plain data."""
    found = answer.location
    return {
        "timestamp": answer.timestamp,
        "boxes": answer.boxes,
        "found": found.is_found,
        "reason": found.reason,
        "confidence": found.confidence,
        "object_ids": found.object_id,
        "candidates": [
            {"pose": one.pose, "covariance": one.covariance, "probability": one.probability}
            for one in found.candidates
        ],
    }
