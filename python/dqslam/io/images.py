"""The image file of each pose, by time stamps, by numbers of frames, or by order."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam.io.files import FileError
from dqslam.io.frames import FrameTimes
from dqslam.io.image_names import ImageNameError, frames_of_images, image_name
from dqslam.io.nearest import nearest_pose

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".pgm", ".tif", ".tiff", ".webp")
_NANOSECONDS = 1e15  # seconds would be after the year 30 000 000


def find_images(
    folder: str | Path, timestamps: Floats, frames: FrameTimes | None = None
) -> dict[int, Path]:
    """Return the image file of each pose that has one, by row; times of the poses (n,), seconds.

    The time of an image comes from the first of

    - ``frames``, by the name of the image or the number in it;
    - its name, if all names are times in seconds (``1311868164.363181.png``; ``000703.png`` where
      poses are at whole seconds) or nanoseconds: the image nearest in time is taken, within half
      the median interval of the poses;
    - its place in the order of names, if there are as many images as poses.
    """
    folder = Path(folder)
    files = _images_in(folder)
    if frames is not None:
        found = _nearest(timestamps, *_framed(files, frames))
        if not found:
            raise FileError(folder, f"no image is of the time of a pose, by {frames.source}")
        return found
    times = _times(files, timestamps)
    found = {} if times is None else _nearest(timestamps, files, times)
    if found:
        return found
    if len(files) == len(timestamps):
        return dict(enumerate(files))
    raise _unknown_times(folder, files, timestamps)


def timed_images(
    folder: str | Path, timestamps: Floats, frames: FrameTimes | None = None
) -> tuple[list[Path], Floats]:
    """Return all image files of a folder in the order of time, and their times (k,), seconds.

    Times come from where ``find_images`` takes them; an image is not held to the time of a pose.
    Images without a time in ``frames`` are left out.

    Raises
    ------
    FileError
        If there are no images, nothing tells their times, or two have the same.
    """
    folder = Path(folder)
    files = _images_in(folder)
    if frames is not None:
        files, times = _framed(files, frames)
        if not files:
            raise FileError(folder, f"no image has a time, by {frames.source}")
    else:
        found = _times(files, timestamps)
        near = () if found is None else _nearest(timestamps, files, found)
        if found is None or not near:
            if len(files) != len(timestamps):
                raise _unknown_times(folder, files, timestamps)
            found = timestamps
        times = found
    order = np.argsort(times, kind="stable")
    files, times = [files[row] for row in order], times[order]
    same = np.flatnonzero(np.diff(times) == 0.0)
    if same.size:
        row = int(same[0])
        message = f"is of the same time as {files[row].name}: {float(times[row])!r} s"
        raise FileError(files[row + 1], message)
    return files, times


def _images_in(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise FileError(folder, "no such folder of images")
    files = sorted(one for one in folder.iterdir() if one.suffix.lower() in SUFFIXES)
    if not files:
        raise FileError(folder, f"holds no images ({', '.join(SUFFIXES)})")
    return files


def _unknown_times(folder: Path, files: list[Path], timestamps: Floats) -> FileError:
    return FileError(
        folder,
        f"{len(files)} images (the first is {files[0].name}), {len(timestamps)} poses from "
        f"{timestamps[0]:.6f} s: the names are not times of poses, so the times of frames are "
        "needed: --frame-times or --frame-rate",
    )


def _framed(files: list[Path], frames: FrameTimes) -> tuple[list[Path], Floats]:
    """Return the images whose frame has a time, and their times."""
    if frames.names:
        numbers = [frames.names.get(image_name(file.name)) for file in files]
    else:
        files = [file for file in files if any(sign.isdigit() for sign in file.stem)]
        names = [file.name for file in files]
        try:
            found, own_times = frames_of_images(names)
        except ImageNameError as error:
            raise FileError(files[error.row], str(error)) from None
        if own_times is not None:
            return list(files), own_times
        numbers = list(found.tolist())
    kept, times = [], []
    for file, frame in zip(files, numbers, strict=True):
        if frame is None or (frames.table is not None and frame not in frames.table):
            continue
        kept.append(file)
        times.append(frame / frames.rate if frames.table is None else frames.table[frame])
    return kept, np.array(times, dtype=float)


def _times(files: list[Path], timestamps: Floats) -> Floats | None:
    """Return the times in the names, or None unless all names are times.

    Whole numbers are usually numbers of frames. They are times only if poses are at whole seconds,
    or if they are so long that they must be nanoseconds.
    """
    names = [image_name(file.name) for file in files]
    try:
        times = np.array([float(name) for name in names])
    except ValueError:
        return None
    if not all(name.isdigit() for name in names):
        return times
    if (times >= _NANOSECONDS).all():
        return 1e-9 * times
    return times if (timestamps == np.round(timestamps)).all() else None


def _nearest(timestamps: Floats, files: list[Path], times: Floats) -> dict[int, Path]:
    """Return the image nearest in time to each pose, within half their median interval."""
    if not files:
        return {}
    tolerance = 0.5 * float(np.median(np.diff(timestamps))) if len(timestamps) > 1 else np.inf
    order = np.argsort(times)
    nearest, off = np.zeros(len(timestamps), dtype=np.int64), np.abs(timestamps - times[0])
    if len(files) > 1:
        nearest, off = nearest_pose(times[order], timestamps)
    return {int(row): files[order[nearest[row]]] for row in np.flatnonzero(off <= tolerance)}
