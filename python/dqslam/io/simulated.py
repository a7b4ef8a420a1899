"""Files of a simulated recording and its truth, which the rest of the program reads."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam._outputs import added_files, output_set
from dqslam.io.camera.table import write_json_camera
from dqslam.io.detections.csv import COLUMNS, write_csv
from dqslam.io.detections.other_classes import OtherClasses
from dqslam.io.detections.table import DetectionTable
from dqslam.io.files import write_text
from dqslam.io.step_covariances import write_step_covariances
from dqslam.io.trajectory import write_trajectory
from dqslam.lens import distort_boxes
from dqslam.recording import Recording, Truth

TRUTH_FILES = ("groundtruth.txt", "objects.csv", "true_boxes.csv")


def save_recording(recording: Recording, directory: str | Path) -> None:
    """Write camera.json, odometry.txt, odometry_covariance.csv and boxes.csv: see `load_recording`.

    The odometry is written as the poses that it leads to, world_from_camera. The id of an object is
    its track_id. Boxes are those of the image as recorded. Relative positions are left out.

    The files of an earlier call are replaced, all at once if the directory has no others.

    Raises
    ------
    ValueError
        If a box reaches beyond the range of the lens; then nothing is written.
    FileError
        If the directory has files of these names that are others' or have been changed.
    """
    with output_set(directory, "save_recording", beside_others=True) as folder:
        write_recording(recording, folder)


def write_recording(recording: Recording, directory: Path) -> None:
    """Write the files of a recording into a folder that has none of them."""
    odometry, boxes = recording.odometry, recording.detections
    recorded = distort_boxes(recording.camera, boxes.box)
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    write_json_camera(directory / "camera.json", recording.camera)
    _write_path(directory / "odometry.txt", recording, odometry.pose_model, path)
    write_step_covariances(directory / "odometry_covariance.csv", recording)
    others = OtherClasses(boxes.other_class_id, boxes.other_score, boxes.class_names)
    table = DetectionTable(
        path=str(directory / "boxes.csv"),
        columns=(*COLUMNS, "track_id"),
        line=np.arange(2, len(boxes) + 2),
        frame=boxes.pose,
        timestamp=recording.timestamps[boxes.pose],
        box=recorded,
        score=boxes.score,
        class_id=boxes.class_id,
        class_name=tuple(boxes.class_names[number] for number in boxes.class_id.tolist()),
        track_id=boxes.object_id,
        others=others if boxes.other_class_id.shape[1] else None,
        embedding=boxes.embedding if boxes.embedding.shape[1] else None,
    )
    write_csv(directory / "boxes.csv", table)


def save_truth(truth: Truth, recording: Recording, directory: str | Path) -> None:
    """Write groundtruth.txt, objects.csv and true_boxes.csv, for `dqslam evaluate`.

    An object that is neither an ellipsoid nor a cuboid has the size of a cube of its volume, and no
    orientation. Files of an earlier call are replaced.

    Raises
    ------
    FileError
        If the directory has files of these names that are others' or have been changed.
    """
    names = TRUTH_FILES if truth.box_object_id is not None else TRUTH_FILES[:2]
    with added_files(directory, names, "save_truth") as folder:
        write_truth(truth, recording, folder)


def write_truth(truth: Truth, recording: Recording, directory: Path) -> None:
    """Write the files of the truth into a folder that has none of them."""
    _write_path(directory / "groundtruth.txt", recording, truth.pose_model, truth.poses)
    names = ["object_id", "class_name", "x", "y", "z", "sx", "sy", "sz"]
    columns: list[Sequence[object]] = [truth.object_ids.tolist(), truth.class_names]
    quaternion = ["qx", "qy", "qz", "qw"]
    if truth.ellipsoids is not None:
        names += quaternion
        rows = [_core.axes_from_ellipsoid(ellipsoid) for ellipsoid in truth.ellipsoids]
        numbers = np.array([[*center, *2.0 * axes, *turn] for center, axes, turn in rows])
    elif truth.cuboids is not None:
        names += quaternion
        center, half, turn = np.split(truth.cuboids, [3, 6], axis=1)
        numbers = np.column_stack([center, 2.0 * half, turn])
    else:
        numbers = np.column_stack([truth.centers, *[np.cbrt(truth.volumes)] * 3])
    columns += _columns(numbers)
    _write_table(directory / "objects.csv", names, columns)
    boxes = recording.detections
    if truth.box_object_id is not None:
        recorded = distort_boxes(recording.camera, boxes.box)
        columns = _columns(np.column_stack([recording.timestamps[boxes.pose], recorded]))
        columns.append(truth.box_object_id.tolist())
        names = ["timestamp", "x1", "y1", "x2", "y2", "track_id"]
        _write_table(directory / "true_boxes.csv", names, columns)


def _write_path(path: Path, recording: Recording, model: _core.PoseModel, poses: Floats) -> None:
    cameras = _core.world_from_camera(model, recording.camera, poses)
    write_trajectory(path, recording.timestamps, cameras)


def _columns(numbers: Floats) -> list[Sequence[object]]:
    """Return numbers (n, k) as k columns of texts, without loss of a bit."""
    return [[repr(value) for value in column] for column in numbers.T.tolist()]


def _write_table(path: Path, names: Sequence[str], columns: Iterable[Sequence[object]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    write_text(path, text.getvalue())
