"""How the files of a recording are read, and reading them together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from dqslam import _core
from dqslam._input import refuse_shared_input
from dqslam.io.camera import read_camera
from dqslam.io.camera.rosbag import KIND as CAMERA_INFO
from dqslam.io.detections import DetectionTable, read_detections
from dqslam.io.detections.rosbag import KIND as DETECTION_ARRAY
from dqslam.io.first_frame import with_first_frame
from dqslam.io.formats import Progress, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.notes import MAX_BAD, Notes
from dqslam.io.readings import AS_USUAL, Readings
from dqslam.io.sources import FormatNames, choose_frame_times, format_of, topic_of
from dqslam.io.span import ALL_TIME, TimeSpan
from dqslam.io.trajectory import Trajectory, read_trajectory
from dqslam.io.trajectory.rosbag import KINDS as TRAJECTORIES


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """How the files of a recording are read: all that they do not say themselves."""

    formats: FormatNames = FormatNames()
    """Names of the formats of files that do not look like what they are."""
    frames: FrameTimes | None = None
    """Times of frames, for files that only count them."""
    first_frame: int | None = None
    """Number of the first frame in the file of boxes; None is that of its format, mostly 0."""
    max_bad: float = MAX_BAD
    """Largest share of bad boxes or poses, 0 to 1, that are left out; with more, or with any if it
    is 0, the file is refused."""
    nms: float | None = None
    """Boxes that overlap a better one of their image by this intersection over union are left out,
    whatever their class; None leaves all."""
    topics: tuple[str, ...] = ()
    """Topics, for bags that have several of a kind."""
    image_size: tuple[int, int] | None = None
    """Width and height of the image in px, for a camera file that has none."""
    camera_id: str | None = None
    """Id of the camera, in a file with several."""
    max_time_difference: float | None = None
    """Most seconds from a box to the nearest pose; None is half the median interval of poses."""
    readings: Readings = AS_USUAL
    """What numbers in the files mean, where it is not what is usual."""
    span: TimeSpan = ALL_TIME
    """The part of the recording that is used: poses and boxes of other times are left out."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        Notes(max_bad=self.max_bad)
        latest = self.max_time_difference
        if latest is not None and not latest >= 0:
            raise ValueError(f"max_time_difference is {latest:g}, negative")
        if self.image_size is not None and min(self.image_size) < 1:
            width, height = self.image_size
            raise ValueError(f"image_size is {width} x {height}, not positive")

    def with_frame_times(self, odometry: str | Path, detections: str | Path) -> ReadOptions:
        """Return these options with the times of frames that both files have, if none are given.

        Where the trajectory counts frames, too, their numbers are their times.
        """
        if self.frames is not None:
            return self
        return replace(self, frames=choose_frame_times(odometry, detections, self.formats))


def read_camera_file(path: str | Path, options: ReadOptions) -> _core.Camera:
    """Read the camera of a recording."""
    return read_camera(
        path,
        format_of(path, "camera", options.formats).name,
        topic=topic_of(path, (CAMERA_INFO,), options.topics),
        camera_id=options.camera_id,
        image_size=options.image_size,
    )


def read_path_file(
    path: str | Path, options: ReadOptions, notes: Notes, *, progress: Progress = no_progress
) -> Trajectory:
    """Read the whole trajectory of the camera of a recording, in meters."""
    trajectory = read_trajectory(
        path,
        format_of(path, "trajectory", options.formats).name,
        frames=options.frames,
        has_mount=options.readings.body_from_camera is not None,
        topic=topic_of(path, TRAJECTORIES, options.topics),
        progress=progress,
        notes=notes,
    )
    return options.readings.trajectory(trajectory)


def read_boxes_file(
    path: str | Path,
    size: tuple[int, int] | None,
    options: ReadOptions,
    notes: Notes,
    *,
    trajectory: Trajectory | None = None,
    classes: dict[int, str] | None = None,
    cut: bool = True,
    check: bool = True,
    min_score: float = 0.0,
    progress: Progress = no_progress,
) -> DetectionTable:
    """Read the boxes of a recording, for an image of this width and height in px.

    They are read as they are meant before they are checked and cut. Their frames may be those of a
    trajectory, the whole one. Boxes of the whole time are returned. ``classes``, ``cut``, ``check``
    and ``min_score`` are those of ``read_detections``.
    """
    readings = options.readings
    if size is None and readings.boxes.image is not None:
        raise ValueError("boxes of another image need the size of the camera's")
    width, height = size or (None, None)
    table = read_detections(
        path,
        format_of(path, "detections", options.formats).name,
        width=width,
        height=height,
        frames=options.frames,
        first_frame=options.first_frame,
        classes=classes,
        cut=cut,
        check=check,
        reread=partial(readings.boxes.read, size=size) if readings.changes_boxes else None,
        min_score=min_score,
        nms=options.nms,
        topic=topic_of(path, (DETECTION_ARRAY,), options.topics),
        progress=progress,
        notes=notes,
    )
    if trajectory is not None:
        table = with_first_frame(table, trajectory.timestamps, options.frames, notes)
    return readings.timed(table)


def check_topics(
    camera: str | Path, odometry: str | Path, detections: str | Path, options: ReadOptions
) -> None:
    """Refuse standard input for two files, and topics that no file has.

    Raises
    ------
    ValueError
        For these.
    """
    refuse_shared_input(camera, odometry, detections)
    kinds = ((CAMERA_INFO,), TRAJECTORIES, (DETECTION_ARRAY,))
    used = {
        topic_of(path, of, [topic])
        for topic in options.topics
        for path, of in zip((camera, odometry, detections), kinds, strict=True)
    }
    for topic in options.topics:
        if topic not in used:
            raise ValueError(
                f"topic {topic}: no bag among the files has it, of a kind that is read"
            )
