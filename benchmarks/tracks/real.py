"""The table of KITTI tracking 0005: movers in the map, the path, and tracks against labels."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import dqslam as dq
from dqslam import io
from dqslam._checks import Floats, Ints
from dqslam.metrics import box_iou

_FOLDER = Path(os.environ.get("DQSLAM_REALDATA", "../shared/realdata")) / "kitti_tracking" / "0005"
# Boxes, where ids come from, and whether these are trusted.
SOURCES = {
    "labels": ("boxes_gt.csv", dq.RunFilesOptions(ids="track_id")),
    "strongsort": (
        "tracks_yolox_strongsort.csv",
        dq.RunFilesOptions(ids="track_id", trust_ids=0.9),
    ),
    "rrc": ("detections_rrc.csv", dq.RunFilesOptions(ids="none")),
}
NOISE = dq.OdometryNoise(0.05, 0.002)
SECONDS = 0.1
# A label moves if its mean speed is above this [m/s], in so many images at least.
_MOVES, _FEWEST = 2.0, 4
# The label of a box overlaps it by so much; the true speed is that over so many images around.
_OVERLAP, _SPAN = 0.5, 5


@dataclass(frozen=True, eq=False)
class Labels:
    """What is labeled: by image, the ids, boxes and centers."""

    ids: dict[int, list[int]]
    boxes: dict[int, Floats]
    places: dict[int, dict[int, Floats]]
    """By id and image, centers in the reference world [m], (3,)."""
    moving: set[int]
    path: Floats
    """world_from_camera of the reference, shape (n, 7)."""


def read_labels() -> Labels:
    """Read the labels of the drive, in the world of its reference trajectory."""
    from scipy.spatial.transform import Rotation

    path = io.read_trajectory(_FOLDER / "trajectory_reference.txt").world_from_camera
    turns = Rotation.from_quat(path[:, 3:]).as_matrix()
    ids: dict[int, list[int]] = {}
    boxes: dict[int, list[list[float]]] = {}
    places: dict[int, dict[int, Floats]] = {}
    for line in (_FOLDER / "label_02.txt").read_text().splitlines():
        cells = line.split()
        image, number = int(cells[0]), int(cells[1])
        if number < 0:
            continue
        values = np.array(cells[6:14], dtype=np.float64)
        x, y, z = np.array(cells[13:16], dtype=np.float64)
        camera = np.array([x + 0.0598, y - 0.5 * float(cells[10]), z + 0.0027])
        ids.setdefault(image, []).append(number)
        boxes.setdefault(image, []).append(values[:4].tolist())
        places.setdefault(number, {})[image] = turns[image] @ camera + path[image, :3]
    moving = set()
    for number, of_image in places.items():
        first, last = min(of_image), max(of_image)
        run = float(np.linalg.norm(of_image[last] - of_image[first]))
        if len(of_image) >= _FEWEST and run / (SECONDS * (last - first)) > _MOVES:
            moving.add(number)
    return Labels(ids, {key: np.array(one) for key, one in boxes.items()}, places, moving, path)


def label_of(labels: Labels, images: Ints, boxes: Floats) -> int | None:
    """Return the label that most of some boxes (n, 4) show, None if they show none."""
    votes: Counter[int] = Counter()
    for image, box in zip(images.tolist(), boxes, strict=True):
        if image in labels.boxes:
            overlap = box_iou(box[None], labels.boxes[image])
            if overlap.max() >= _OVERLAP:
                votes[labels.ids[image][int(overlap.argmax())]] += 1
    return votes.most_common(1)[0][0] if votes else None


def track_boxes(result: dq.RunResult, track: dq.Track) -> Floats:
    """Return the boxes of a track's corners, (n, 4)."""
    from scipy.spatial.transform import Rotation

    camera, poses = result.estimate.camera, result.estimate.poses[track.pose]
    turns = Rotation.from_quat(poses[:, 3:]).as_matrix()
    seen = (track.corners() - poses[:, None, :3]) @ turns
    depth = np.where(seen[..., 2] > 0.1, seen[..., 2], np.nan)
    u = camera.cx + camera.fx * seen[..., 0] / depth
    v = camera.cy + camera.fy * seen[..., 1] / depth
    edges = [np.nanmin(u, 1), np.nanmin(v, 1), np.nanmax(u, 1), np.nanmax(v, 1)]
    last = np.array([camera.width, camera.height, camera.width, camera.height]) - 0.5
    return np.column_stack(edges).clip(-0.5, last)


def errors_of(
    labels: Labels, result: dq.RunResult, track: dq.Track, number: int
) -> tuple[list[float], float]:
    """Return errors of the motion from image to image [m], and the median one of the speed [m/s].

    Motions are compared as the camera sees them, so that the error of the path is not in them.
    """
    from scipy.spatial.transform import Rotation

    places, poses = labels.places[number], result.estimate.poses[track.pose]
    turn = Rotation.from_quat(labels.path[track.pose, 3:]) * Rotation.from_quat(poses[:, 3:]).inv()
    motion, speed = [], []
    for row, image in enumerate(track.pose.tolist()):
        before, after = image - _SPAN, image + _SPAN
        if before in places and after in places:
            run = np.linalg.norm(places[after] - places[before])
            speed.append(abs(track.speeds[row] - run / (SECONDS * (after - before))))
        following = int(track.pose[row + 1]) if row + 1 < len(track) else -1
        if image in places and following == image + 1 and following in places:
            step = turn[row].apply(track.centers[row + 1] - track.centers[row])
            motion.append(float(np.linalg.norm(step - places[following] + places[image])))
    return motion, float(np.median(speed)) if speed else np.nan


def row_of(labels: Labels, source: str, seed: int) -> str:
    """Return the row of a run."""
    boxes, options = SOURCES[source]
    result = dq.run_files(
        _FOLDER / "camera.json",
        _FOLDER / "trajectory_reference.txt",
        _FOLDER / boxes,
        replace(options, added_noise=NOISE, seed=seed),
    )
    return describe(labels, f"{source}, {seed}", result)


def describe(labels: Labels, name: str, result: dq.RunResult) -> str:
    """Return the row of a result."""
    shown, estimate = result.detections, result.estimate
    mapped = [
        label_of(labels, shown.pose[own], shown.box[own])
        for one in estimate.object_ids.tolist()
        for own in [shown.object_id == one]
    ]
    motion: list[float] = []
    speed: list[float] = []
    tracked, wrong = set(), 0
    for track in estimate.tracks:
        number = label_of(labels, track.pose, track_boxes(result, track))
        if number not in labels.moving:
            wrong += number is not None
            continue
        tracked.add(number)
        motions, off = errors_of(labels, result, track, number)
        motion += motions
        speed.append(off)
    error = result.report["trajectory_error"]
    before, after = (error[when]["ate_rmse_m"] for when in ("before", "after"))
    in_map = sum(one in labels.moving for one in mapped)
    return (
        f"| {name} | {in_map} | {len(mapped) - in_map} | {before:.2f}, {after:.2f} | "
        f"{len(tracked)} of {len(labels.moving)}, {wrong} at rest | "
        f"{np.median(motion) if motion else np.nan:.3f} | "
        f"{np.nanmedian(speed) if speed else np.nan:.2f}, "
        f"{np.nanmax(speed) if speed else np.nan:.2f} |"
    )


def tabulate(
    sources: Annotated[
        list[str] | None, typer.Argument(help="labels, strongsort, rrc; by default all.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Draws of the odometry's noise.")] = 10,
) -> None:
    """Run KITTI tracking 0005 with noise of 0.05 m and 0.002 rad a step, in $DQSLAM_REALDATA."""
    labels = read_labels()
    typer.echo(
        "| boxes, seed | movers in the map | others | ATE [m]: odometry, estimate | "
        "movers tracked | motion a frame [m] | speed [m/s]: median, worst |"
    )
    typer.echo("|---|---|---|---|---|---|---|")
    for source in sources or SOURCES:
        if source not in SOURCES:
            raise typer.BadParameter(f"{source!r} is none of {', '.join(SOURCES)}")
        for seed in range(seeds):
            typer.echo(row_of(labels, source, seed))
