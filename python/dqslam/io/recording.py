"""Read a recording from files: each box gets the pose of its time and the object of its id."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.assumptions import OdometryNoise
from dqslam.io.detections import DetectionTable
from dqslam.io.detections.table import cut_to_image
from dqslam.io.extras import Extras
from dqslam.io.files import FileError
from dqslam.io.nearest import nearest_pose
from dqslam.io.notes import Notes
from dqslam.io.reading import (
    ReadOptions,
    check_topics,
    read_boxes_file,
    read_camera_file,
    read_path_file,
)
from dqslam.io.step_covariances import read_step_covariances
from dqslam.io.trajectory import Trajectory
from dqslam.lens import undistorted_or_nan
from dqslam.recording import Detections, Odometry, Recording
from dqslam.recording.interpolation import split_steps

# With two boxes and a noisy path, the distance of an object cannot be separated from its size.
FEWEST_BOXES = 3

# An image this much of an interval from a pose has its own pose, except in longer intervals than so
# many usual ones.
NEAR_SHARE, LONGEST_INTERVAL = 0.05, 2.5
ROUNDING = 1e-6

Ids = Literal["none", "track_id", "class_id"]


@dataclass(frozen=True)
class Dropped:
    """Numbers of boxes that are in the files but not in the recording, by reason."""

    below_min_score: int  #: boxes whose score is below the least score
    without_id: int  #: boxes whose id is -1 or empty
    without_pose: int  #: boxes with no pose near enough in time
    repeated: int  #: boxes with a better one of the same object at the same pose
    few_boxes: dict[int, int]  #: number of boxes of each object id with fewer than 3
    beyond_lens: int = 0  #: boxes that reach beyond the range of the lens model

    @property
    def total(self) -> int:
        """The number of all dropped boxes."""
        counted = self.below_min_score + self.without_id + self.without_pose + self.repeated
        counted += self.beyond_lens
        return counted + sum(self.few_boxes.values())


def load_recording(
    camera: str | Path,
    odometry: str | Path,
    detections: str | Path,
    *,
    min_score: float = 0.5,
    ids: Ids = "track_id",
    final_ids: bool = True,
    odometry_noise: OdometryNoise | None = None,
    odometry_covariance: str | Path | None = None,
    reading: ReadOptions | None = None,
    notes: Notes | None = None,
    extras: Extras | None = None,
    interpolate: bool = True,
    examine: Callable[[_core.Camera, Trajectory, DetectionTable], None] | None = None,
) -> tuple[Recording, Dropped]:
    """Read a recording in SE(3), where the robot is the camera, and the numbers of dropped boxes.

    Parameters
    ----------
    camera, odometry, detections
        Files in any of the formats that ``read_camera``, ``read_trajectory`` and
        ``read_detections`` know.
    min_score
        Boxes with a lower score, 0 to 1, are left out.
    ids
        The column of ids, which are equal for boxes of the same object. With "none", boxes have no
        object yet.
    final_ids
        Whether these ids are final. Then three kinds of boxes are left out: those without an id,
        the worse one of two boxes with the same id in an image, and those whose id has fewer than 3
        boxes.
    odometry_noise
        The uncertainty of each step, because trajectory files have none.
    odometry_covariance
        A file with the covariance of each step, which replaces ``odometry_noise``: see
        ``io.step_covariances``.
    reading
        How the files are read, and what numbers in them mean, by default ``ReadOptions()``.
    notes
        Collects what is left out of the files and what is doubtful in them; by default these are
        warnings of Python, of the category ``InputWarning``.
    extras
        Files of other measurements: see ``io.measurements``.
    interpolate
        Whether images between two poses get poses of their own, at constant velocity, and those
        before the first and after the last pose are left out. If not, a box belongs to the nearest
        pose.
    examine
        Called with camera, trajectory and the uncut boxes of at least the least score, before they
        become a recording; what it raises ends that.

    Raises
    ------
    FileError
        If a file is missing or wrong, or no box is left.
    ValueError
        If a setting is out of its range.

    Examples
    --------
    The files of a robot, here of a simulated drive:

    >>> import dqslam as dq
    >>> simulated, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> dq.io.save_recording(simulated, "drive")
    >>> recording, dropped = dq.load_recording(
    ...     "drive/camera.json", "drive/odometry.txt", "drive/boxes.csv"
    ... )
    >>> recording
    Recording(SE3, 253 poses, 456 boxes of 10 objects, 1 class)
    >>> dropped.few_boxes
    {}
    """
    if not 0 <= min_score <= 1:
        raise ValueError(f"min_score is {min_score:g}, not between 0 and 1")
    how = reading or ReadOptions()
    own = Notes(max_bad=how.max_bad) if notes is None else notes
    check_topics(camera, odometry, detections, how)
    lens = read_camera_file(camera, how)
    whole = read_path_file(odometry, how, own)
    trajectory = how.span.of_path(whole, odometry)
    pose_times, path = trajectory
    if len(pose_times) < 2:
        raise FileError(odometry, "one pose only: nothing moves")
    size = (lens.width, lens.height)
    # Uncut, because boxes that leave the image tell that they are of another one.
    table = read_boxes_file(
        detections, size, how, own, trajectory=whole, cut=False, min_score=min_score
    )
    table = how.span.of_boxes(table)
    if examine is not None:
        taking_part = table.score >= min_score
        examine(lens, trajectory, table.select(taking_part) if taking_part.any() else table)
    table = cut_to_image(table, *size, notes=own, min_score=min_score)
    if notes is None:
        own.warn()
    object_id = object_ids(table, ids)
    covariance = (odometry_noise or OdometryNoise()).covariance(len(path) - 1)
    if odometry_covariance is not None:
        every = read_step_covariances(odometry_covariance, whole.timestamps)
        first = int(np.searchsorted(whole.timestamps, pose_times[0]))
        covariance = every[first : first + len(path) - 1]
    steps, times = Odometry.from_poses(path, covariance=covariance), pose_times
    _, late = nearest_pose(times, table.timestamp)
    half = 0.5 * float(np.median(np.diff(times)))
    latest = how.max_time_difference
    tolerance = half * (1 + ROUNDING) if latest is None else latest
    if interpolate:
        outside = (table.timestamp < times[0]) | (table.timestamp > times[-1])
        late[outside & (late > 2 * NEAR_SHARE * half)] = np.inf
        steps, times = split_steps(steps, times, _between_poses(table.timestamp, late, times))
    pose, apart = nearest_pose(times, table.timestamp)
    apart = np.where(late <= tolerance, apart, np.inf)
    box = undistorted_or_nan(lens, table.box) if lens.has_distortion else table.box
    final = final_ids and ids != "none"
    rows, dropped = (_select if final else _select_images)(
        table, object_id, pose, apart, _scored(table, box, min_score), tolerance
    )
    beyond = int(np.sum((table.score >= min_score) & ~np.isfinite(box).all(axis=1)))
    dropped = replace(dropped, beyond_lens=beyond, below_min_score=dropped.below_min_score - beyond)
    if not rows.size:
        raise FileError(detections, _nothing_left(table, dropped, ids, tolerance, times))
    recording = Recording(
        camera=lens,
        timestamps=times,
        odometry=steps,
        detections=Detections(
            pose=pose[rows],
            box=box[rows],
            score=table.score[rows],
            class_id=table.class_id[rows],
            object_id=object_id[rows],
            class_names=class_names_of(table),
            **more_of_boxes(table, rows),
        ),
    )
    return (extras or Extras()).added_to(recording, tolerance, whole.timestamps), dropped


def class_names_of(table: DetectionTable) -> dict[int, str]:
    """Return the names of the classes of boxes and of their other classes; else their numbers."""
    names = dict(table.others.class_names) if table.others is not None else {}
    names |= dict(zip(table.class_id.tolist(), table.class_name, strict=True))
    return {number: name or str(number) for number, name in names.items()}


def more_of_boxes(table: DetectionTable, rows: NDArray[np.int64]) -> dict[str, Any]:
    """Return the fields of detections that only some files have."""
    fields: dict[str, Any] = {}
    if table.others is not None:
        others = table.others.select(rows)
        fields |= {"other_class_id": others.class_id, "other_score": others.score}
    if table.embedding is not None:
        fields["embedding"] = table.embedding[rows]
    return fields


def _scored(table: DetectionTable, box: NDArray[np.float64], min_score: float) -> NDArray[np.bool_]:
    """Tell which boxes have the least score and are not beyond the lens, shape (m,)."""
    return np.asarray((table.score >= min_score) & np.isfinite(box).all(axis=1))


def _between_poses(
    times: NDArray[np.float64], late: NDArray[np.float64], pose_times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the times (k,) of boxes, of all (m,), that are too far from the nearest pose."""
    before = np.clip(np.searchsorted(pose_times, times) - 1, 0, len(pose_times) - 2)
    interval = pose_times[before + 1] - pose_times[before]
    # In a gap of the odometry, its velocity is not known.
    usual = interval <= LONGEST_INTERVAL * float(np.median(np.diff(pose_times)))
    return np.unique(times[usual & (late > NEAR_SHARE * interval)])


def object_ids(table: DetectionTable, ids: Ids) -> NDArray[np.int64]:
    """Return the id of the object of each box, shape (m,), -1 without one; with "none" all are -1.

    Raises
    ------
    FileError
        If the file has no ids of tracks, and these are wanted.
    ValueError
        If ``ids`` is none of the three.
    """
    if ids == "none":
        return np.full(len(table), -1, dtype=np.int64)
    if ids == "class_id":
        return table.class_id
    if ids != "track_id":
        raise ValueError(f"ids is {ids!r}, not 'track_id', 'class_id' or 'none'")
    if table.track_id is None:
        message = f"no column track_id (it has: {', '.join(table.columns)})"
        raise FileError(table.path, message, 1)
    return table.track_id


def _select(
    table: DetectionTable,
    object_id: NDArray[np.int64],
    pose: NDArray[np.int64],
    late: NDArray[np.float64],
    scored: NDArray[np.bool_],
    tolerance: float,
) -> tuple[NDArray[np.int64], Dropped]:
    """Choose rows: one box per object and pose, at least 3 per object, by pose and object."""
    score = table.score
    named = scored & (object_id >= 0)
    timely = named & (late <= tolerance)
    rows = np.flatnonzero(timely)
    # The box nearest in time comes first, and of those in one image the one with the best score.
    order = rows[np.lexsort((-score[rows], late[rows], object_id[rows], pose[rows]))]
    again = (pose[order][1:] == pose[order][:-1]) & (object_id[order][1:] == object_id[order][:-1])
    best = order[np.concatenate([[True], ~again])[: len(order)]]
    objects, counts = np.unique(object_id[best], return_counts=True)
    few = counts < FEWEST_BOXES
    dropped = Dropped(
        below_min_score=int(np.sum(~scored)),
        without_id=int(np.sum(scored & ~named)),
        without_pose=int(np.sum(named & ~timely)),
        repeated=len(rows) - len(best),
        few_boxes=dict(zip(objects[few].tolist(), counts[few].tolist(), strict=True)),
    )
    return best[~np.isin(object_id[best], objects[few])], dropped


def _select_images(
    table: DetectionTable,
    object_id: NDArray[np.int64],
    pose: NDArray[np.int64],
    late: NDArray[np.float64],
    scored: NDArray[np.bool_],
    tolerance: float,
) -> tuple[NDArray[np.int64], Dropped]:
    """Choose rows, by pose: all boxes of the image that is nearest in time to each pose."""
    timely = scored & (late <= tolerance)
    rows = np.flatnonzero(timely)
    rows = rows[np.lexsort((rows, late[rows], pose[rows]))]
    _, first, group = np.unique(pose[rows], return_index=True, return_inverse=True)
    chosen = rows[table.frame[rows] == table.frame[rows[first]][group.reshape(-1)]]
    dropped = Dropped(
        below_min_score=int(np.sum(~scored)),
        without_id=0,
        without_pose=int(np.sum(scored & ~timely)),
        repeated=len(rows) - len(chosen),
        few_boxes={},
    )
    return chosen, dropped


def _nothing_left(
    table: DetectionTable, dropped: Dropped, ids: Ids, tolerance: float, times: NDArray[np.float64]
) -> str:
    """Return the reason why none of the boxes can be used."""
    unnamed = "" if ids == "none" else f"{dropped.without_id} without {ids}, "
    return (
        f"no object is left of {len(table.line)} boxes: {dropped.below_min_score} below the least "
        f"score, {dropped.beyond_lens} beyond the lens, {unnamed}{dropped.without_pose} further "
        f"than {tolerance:g} s from a pose (boxes {table.timestamp.min():.6f} to "
        f"{table.timestamp.max():.6f} s, poses {times[0]:.6f} to {times[-1]:.6f} s), "
        f"{dropped.repeated} repeated, {sum(dropped.few_boxes.values())} of objects with fewer "
        f"than {FEWEST_BOXES}"
    )
