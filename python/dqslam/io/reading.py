"""How the files of a recording are read, and reading them together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from dqslam import _core
from dqslam._input import refuse_shared_input
from dqslam.io.camera import read_camera
from dqslam.io.camera.rosbag import KIND as CAMERA_INFO
from dqslam.io.detections import DetectionTable, read_detections
from dqslam.io.detections.rosbag import KIND as DETECTION_ARRAY
from dqslam.io.first_frame import with_first_frame
from dqslam.io.frames import FrameTimes
from dqslam.io.notes import MAX_BAD, Notes
from dqslam.io.readings import AS_USUAL, Readings
from dqslam.io.sources import FormatNames, topic_of
from dqslam.io.trajectory import Trajectory, read_trajectory
from dqslam.io.trajectory.rosbag import KINDS as TRAJECTORIES


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """How the files of a recording are read, beside their formats and the times of frames."""

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
    readings: Readings = AS_USUAL
    """What numbers in the files mean, where it is not what is usual."""

    def __post_init__(self) -> None:
        """Check the topics."""
        Notes(max_bad=self.max_bad)


def read_camera_file(path: str | Path, formats: FormatNames, options: ReadOptions) -> _core.Camera:
    """Read the camera of a recording."""
    topic = topic_of(path, (CAMERA_INFO,), options.topics)
    return read_camera(
        path,
        formats.camera,
        topic=topic,
        camera_id=options.camera_id,
        image_size=options.image_size,
    )


def read_path_file(
    path: str | Path,
    formats: FormatNames,
    frames: FrameTimes | None,
    options: ReadOptions,
    notes: Notes,
) -> Trajectory:
    """Read the trajectory of the camera of a recording, in meters."""
    trajectory = read_trajectory(
        path,
        formats.trajectory,
        frames=frames,
        has_mount=options.readings.body_from_camera is not None,
        topic=topic_of(path, TRAJECTORIES, options.topics),
        notes=notes,
    )
    return options.readings.trajectory(trajectory)


def read_boxes_file(
    path: str | Path,
    camera: _core.Camera,
    trajectory: Trajectory,
    formats: FormatNames,
    frames: FrameTimes | None,
    options: ReadOptions,
    notes: Notes,
    *,
    min_score: float = 0.0,
    check: bool = True,
) -> DetectionTable:
    """Read the boxes of a recording, whose frames may be those of the trajectory.

    They are read as they are meant before they are checked and cut. Without ``check`` they are not,
    for a search for mistakes.
    """
    readings, size = options.readings, (camera.width, camera.height)
    table = read_detections(
        path,
        formats.detections,
        width=camera.width,
        height=camera.height,
        frames=frames,
        first_frame=options.first_frame,
        check=check,
        reread=partial(readings.boxes.read, size=size) if readings.changes_boxes else None,
        min_score=min_score,
        nms=options.nms,
        topic=topic_of(path, (DETECTION_ARRAY,), options.topics),
        notes=notes,
    )
    table = with_first_frame(table, trajectory.timestamps, frames, notes)
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
