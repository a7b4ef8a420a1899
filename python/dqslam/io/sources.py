"""Settings for several files together: the names of formats and the times of frames."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from dqslam._input import exists, refuse_shared_input
from dqslam.io.camera import CAMERA_FORMATS
from dqslam.io.detections import DETECTION_FORMATS
from dqslam.io.files import FileError, read_rows, read_text
from dqslam.io.formats import Format, choose_format, guarded, look_at
from dqslam.io.frames import BY_NUMBER, FrameTimes
from dqslam.io.rosbag import bag_topics, looks_like_bag
from dqslam.io.trajectory import TRAJECTORY_FORMATS

# A key that a JSON has if it is of a camera, and that none of detections has.
CAMERA_KEYS = re.compile(
    r'"(fx|fl_x|ppx|f|focal(_length)?|K|[Cc]amera_?[Mm]atrix|intrinsics?|intrinsic_?[Mm]atrix)"\s*:'
)


class FormatNames(NamedTuple):
    """The format of each file; None recognizes it from the file."""

    camera: str | None = None
    trajectory: str | None = None
    detections: str | None = None


BY_LOOK = FormatNames()
PHRASES = {"camera": "a camera", "trajectory": "a trajectory", "detections": "boxes"}
FORMATS: dict[str, Sequence[Format[Any]]] = {
    "camera": CAMERA_FORMATS,
    "trajectory": TRAJECTORY_FORMATS,
    "detections": DETECTION_FORMATS,
}
KINDS = {kind: [format_.name for format_ in formats] for kind, formats in FORMATS.items()}


def split_formats(names: Sequence[str]) -> FormatNames:
    """Assign names of formats to the kinds of files; ``rosbag`` is a format of all three kinds.

    Raises
    ------
    ValueError
        If a name is unknown, or two names are of the same kind.
    """
    chosen: dict[str, str] = {}
    # The format rosbag is for the kinds that have no other one.
    for name in sorted(names, key=lambda name: sum(name in known for known in KINDS.values())):
        kinds = [kind for kind, known in KINDS.items() if name in known]
        if not kinds:
            known = dict.fromkeys(name for names in KINDS.values() for name in names)
            raise ValueError(f"format {name!r} is none of {', '.join(known)}")
        free = [kind for kind in kinds if kind not in chosen]
        if not free:
            raise ValueError(f"formats {chosen[kinds[0]]} and {name} are both of {kinds[0]}")
        chosen |= dict.fromkeys(free, name)
    return FormatNames(**chosen)


def format_of(path: str | Path, kind: str, formats: FormatNames = BY_LOOK) -> Format[Any]:
    """Choose the format of a file that should be a camera, a trajectory or detections.

    Raises
    ------
    FileError
        If it is in no format of this kind; the error says which kind it looks like instead.
    """
    try:
        return choose_format(path, getattr(formats, kind), FORMATS[kind], kind)
    except FileError as error:
        try:
            other = kind_of(path)
        except FileError:
            raise error from None
        if other is None or other == kind:
            raise
        message = f"looks like {PHRASES[other]}, not like {PHRASES[kind]}"
        raise FileError(path, f"{message}: are two files exchanged?") from None


def choose_frame_times(
    odometry: str | Path,
    detections: str | Path,
    formats: FormatNames = BY_LOOK,
) -> FrameTimes | None:
    """Choose the times of frames for a trajectory and boxes whose files give none.

    If the trajectory numbers frames, the number of a frame is its time, for both files. Otherwise
    the result is None: the boxes have times of their own, or reading them raises an error.
    """
    refuse_shared_input(odometry, detections)
    path = format_of(odometry, "trajectory", formats)
    boxes = format_of(detections, "detections", formats)
    timed = guarded(odometry, path.name, path.has_times, Path(odometry))
    return None if timed or boxes.name == "rosbag" else BY_NUMBER


def topic_of(path: str | Path, kinds: Sequence[str], topics: Sequence[str]) -> str | None:
    """Return the topic among ``topics`` that has messages of one of these kinds in a bag.

    The result is None for a file that is no bag, and for a bag without such a topic.

    Raises
    ------
    ValueError
        If there are two such topics.
    """
    if not topics or not exists(path) or not looks_like_bag(look_at(path)):
        return None
    has = bag_topics(path)
    found = [topic for topic in dict.fromkeys(topics) if has.get(topic) in kinds]
    if len(found) > 1:
        raise ValueError(f"topics {found[0]} and {found[1]} are both of {has[found[0]]}")
    return found[0] if found else None


def kind_of(path: str | Path) -> str | None:
    """Recognize whether a file has a camera, a trajectory or detections; None for a bag.

    Raises
    ------
    FileError
        If the file is in no known format.
    """
    look = look_at(path)
    if looks_like_bag(look):
        return None
    if look.suffix == ".json":
        return "camera" if CAMERA_KEYS.search(read_text(path)) else "detections"
    for kind, formats in FORMATS.items():
        if any(guarded(path, one.name, one.recognize, look) for one in formats):
            return kind
    if not look.path.is_dir():
        read_rows(path)  # its error names the cause: empty, comments only, or no text
    known = ", ".join(dict.fromkeys(name for names in KINDS.values() for name in names))
    raise FileError(path, f"is in no known format; name it with --format: {known}")
