"""Answers of ``dqslam locate``, counted and timed: in rooms, in a recording, in a large map."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import dqslam as dq
from benchmarks.places import rooms

CONFIDENCES = (0.5, 0.8, 0.9, 0.95, 0.99, 0.999)
RIGHT_M, RIGHT_RAD = 0.5, 0.26
SE3 = dq.PoseModel.SE3


@dataclass
class Answers:
    """Best candidates of images, answers or not."""

    confidence: list[float] = field(default_factory=list)
    error_m: list[float] = field(default_factory=list)
    right: list[bool] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    complete: list[bool] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(
        self,
        place: dq.PlaceMap,
        boxes: dq.Detections,
        camera: dq.Camera,
        true_pose: np.ndarray | None,
    ) -> None:
        """Locate an image; ``true_pose`` (7,) is None if it is of another place."""
        start = time.process_time()
        found = dq.locate(place, boxes, camera, min_confidence=1e-9)
        self.seconds.append(time.process_time() - start)
        self.complete.append(found.is_found)
        self.confidence.append(found.confidence)
        if not found.candidates or true_pose is None:
            self.error_m.append(np.nan)
            self.nees.append(np.nan)
            self.right.append(False)
            return
        best = found.candidates[0]
        apart = dq._core.minus(SE3, true_pose[None], best.pose[None])[0]
        meters, radians = (float(np.linalg.norm(part)) for part in (apart[:3], apart[3:]))
        self.error_m.append(meters)
        self.nees.append(apart @ np.linalg.inv(best.covariance) @ apart)
        self.right.append(bool(meters < RIGHT_M and radians < RIGHT_RAD))

    def show(self, title: str, images: int) -> None:
        """Print a row for each least confidence; ``images`` could have had a right answer."""
        table = Table(title=title)
        for name in (
            "least confidence",
            "answers",
            "right answers",
            "right of all images",
            "wrong of all images",
            "mean error [m]",
            "median NEES (5.3)",
        ):
            table.add_column(name, justify="right")
        confidence, right = np.array(self.confidence), np.array(self.right)
        error, nees = np.array(self.error_m), np.array(self.nees)
        for least in CONFIDENCES:
            given = np.array(self.complete) & (confidence >= least)
            if given.any():
                table.add_row(
                    f"{least}",
                    str(given.sum()),
                    f"{right[given].mean():.1%}",
                    f"{(given & right).sum() / images:.1%}",
                    f"{(given & ~right).sum() / len(given):.1%}",
                    f"{np.nanmean(error[given]):.3f}",
                    f"{np.nanmedian(nees[given & right]):.1f}",
                )
        Console(width=110).print(table)
        seconds = np.array(self.seconds)
        typer.echo(
            f"{len(seconds)} images, CPU {seconds.mean():.4f} s each, at most {seconds.max():.3f}"
        )


def count_rooms(
    count: Annotated[int, typer.Option(help="Rooms.")] = 40,
    seed: Annotated[int, typer.Option(help="Of the first room.")] = 100,
    changed: Annotated[float, typer.Option(help="Share of objects that changed.")] = 0.15,
) -> None:
    """Count right answers: 16 images of each room after a change, 4 of another room."""
    answers, images = Answers(), 0
    for number in range(seed, seed + count):
        random = np.random.default_rng(number)
        room = rooms.draw_room(random)
        place = dq.PlaceMap.of(rooms.map_room(room, 60, random))
        other = rooms.draw_objects(room, len(room.class_id), random)
        for where, several in ((rooms.change_room(room, changed, random), 16), (other, 4)):
            poses = rooms.draw_poses(where, several, random)
            boxes = rooms.detections_of(where, rooms.draw_boxes(where, poses, random))
            for image, pose in enumerate(poses):
                own = boxes.select(boxes.pose == image)
                if len(own):
                    answers.add(place, own, rooms.CAMERA, None if where is other else pose)
                    images += where is not other
    answers.show(f"{count} rooms from seed {seed}, images in the room {images}", images)


def locate_recording(
    known: Annotated[Path, typer.Argument(metavar="MAP", help="Results: the map.")],
    camera: Annotated[Path, typer.Option()],
    odometry: Annotated[Path, typer.Option()],
    detections: Annotated[Path, typer.Option()],
    truth: Annotated[
        Path | None, typer.Option(help="Results with the poses of all images. Default: MAP.")
    ] = None,
    every: Annotated[int, typer.Option(help="Locate each such pose.")] = 30,
    min_score: float = 0.3,
) -> None:
    """Locate images of a recording; with --truth, those after the end of the map."""
    results = dq.load_results(known)
    whole = results if truth is None else dq.load_results(truth)
    poses = whole.poses if truth is None else _in_frame(whole, results)
    recording, _ = dq.load_recording(camera, odometry, detections, ids="none", min_score=min_score)
    rows = np.searchsorted(recording.timestamps, whole.timestamps - 1e-6)
    place, boxes, answers = dq.PlaceMap.of(results), recording.detections, Answers()
    first = 0 if truth is None else int(np.sum(whole.timestamps <= results.timestamps[-1] + 1.0))
    for row in range(-(-first // every) * every, len(poses), every):
        own = boxes.select(boxes.pose == rows[row])
        if len(own):
            answers.add(place, own, recording.camera, poses[row])
    answers.show(f"{known}, every {every}th pose", len(answers.seconds))


def _in_frame(whole: dq.io.Results, part: dq.io.Results) -> np.ndarray:
    """Return the poses of a result in the frame of another, by the poses that both have."""
    rows = np.searchsorted(whole.timestamps, part.timestamps - 1e-6)
    return dq.align_rigid(whole.poses[rows, :3], part.poses[:, :3]).apply_poses(whole.poses)


def locate_in_large_map(
    count: Annotated[int, typer.Option(help="Objects.")] = 10_000,
    classes: Annotated[int, typer.Option()] = 20,
    images: Annotated[int, typer.Option()] = 50,
    seed: int = 0,
) -> None:
    """Locate images in a map of many objects, one on each square meter."""
    random = np.random.default_rng(seed)
    extent = float(np.sqrt(count))
    usual = np.exp(random.normal(np.log(0.15), 0.4, (classes, 3)))
    room = rooms.furnish(extent, usual, random.integers(0, classes, count), random)
    place = dq.PlaceMap.of(rooms.map_room(room, 60, random, everything=True))
    poses = rooms.draw_poses(room, images, random)
    boxes = rooms.detections_of(room, rooms.draw_boxes(room, poses, random))
    answers = Answers()
    dq.locate(place, boxes.select(boxes.pose == 0), rooms.CAMERA)  # builds the index
    for image, pose in enumerate(poses):
        own = boxes.select(boxes.pose == image)
        if len(own):
            answers.add(place, own, rooms.CAMERA, pose)
    answers.show(f"{count} objects of {classes} classes", len(answers.seconds))
