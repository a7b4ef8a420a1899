"""Images of a folder or of a film, one after the other, with their frames and times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dqslam.io.files import FileError
from dqslam.io.frames import FrameTimes
from dqslam.io.image_names import ImageNameError, frames_of_images, image_name
from dqslam.io.images import SUFFIXES


@dataclass(frozen=True)
class Frame:
    """One image (height, width, 3) of blue, green, red, as OpenCV reads it.

    ``time`` s is None if nothing tells it; ``share`` is the part of all images, 0 to 1, with it.
    """

    number: int
    time: float | None
    name: str
    image: Any
    share: float


@dataclass(frozen=True)
class ImageFiles:
    """The images of a folder in the order of their frames, with the times that are known."""

    files: tuple[Path, ...]
    numbers: tuple[int, ...]
    times: tuple[float, ...] | None

    def frames(self, every: int = 1) -> Iterator[Frame]:
        """Read each image, or every one of so many."""
        count = len(self.files)
        for row in range(0, count, every):
            time = None if self.times is None else self.times[row]
            file, image = self.files[row], read_image(self.files[row])
            yield Frame(self.numbers[row], time, file.name, image, min(1.0, (row + every) / count))


@dataclass(frozen=True)
class Film:
    """A film; times are those of its file, from 0 s at its first frame."""

    path: Path
    given: FrameTimes | None = None

    def frames(self, every: int = 1) -> Iterator[Frame]:
        """Read each frame, or every one of so many."""
        import cv2

        film = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG)
        try:
            if not film.isOpened():
                raise FileError(self.path, "is no film that OpenCV can read")
            expected, number, before = film.get(cv2.CAP_PROP_FRAME_COUNT), 0, -np.inf
            while film.grab():
                if number % every == 0:
                    # The time of the frame that was grabbed, whether the rate is constant or not.
                    time = self._time(number, 1e-3 * film.get(cv2.CAP_PROP_POS_MSEC), before)
                    before = time
                    _, image = film.retrieve()
                    share = min(1.0, (number + 1) / expected) if expected > 0 else 0.0
                    yield Frame(number, time, "", image, share)
                number += 1
        finally:
            film.release()
        if number == 0:
            raise FileError(self.path, "has no frame that OpenCV can read")
        if number < 0.9 * expected:
            message = f"ends after {number} of {expected:.0f} frames, the rest cannot be read"
            raise FileError(self.path, message)

    def _time(self, number: int, own: float, before: float) -> float:
        time = own
        if self.given is not None:
            time = float(self.given.at(self.path, np.array([number]), [number + 1])[0])
        if not time > before:
            message = f"frame {number} is at {time:g} s, not after {before:g} s: --frame-rate says"
            raise FileError(self.path, message + " the rate if the film does not")
        return time


def read_image(path: Path) -> Any:
    """Read an image as (height, width, 3) uint8, turned as its EXIF says, like all of OpenCV."""
    import cv2

    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}") from None
    try:
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error:
        image = None
    if image is None:
        raise FileError(path, "is no image that OpenCV can read")
    return image


def find_frames(path: str | Path, given: FrameTimes | None) -> ImageFiles | Film:
    """Return the images of a folder, or a film, with the times that are given or known.

    The frame of an image is the number in its name, see ``io.image_names``; its time comes from
    ``given``, by its name or number, or from its name. Images without a given time are left out.
    """
    path = Path(path)
    if path.is_file():
        return Film(path, given)
    if not path.is_dir():
        raise FileError(path, "no such folder of images, or film")
    files = sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES)
    if not files:
        raise FileError(path, f"holds no images ({', '.join(SUFFIXES)})")
    if given is not None and given.names:
        return _listed(path, files, given)
    try:
        numbers, named = frames_of_images([file.name for file in files])
    except ImageNameError as error:
        if len(files) > 1:
            raise FileError(files[error.row], str(error)) from None
        numbers, named = np.zeros(1, dtype=np.int64), None
    order = np.argsort(numbers)
    files = [files[row] for row in order]
    numbers = numbers[order]
    if given is None:
        times = None if named is None else named[order]
    else:
        times = given.at(path, numbers, list(range(1, len(files) + 1)))
    return ImageFiles(
        tuple(files), tuple(numbers.tolist()), None if times is None else tuple(times.tolist())
    )


def _listed(path: Path, files: list[Path], given: FrameTimes) -> ImageFiles:
    """Return the images that a list names, in its order."""
    by_frame = {
        given.names[image_name(file.name)]: file
        for file in files
        if image_name(file.name) in given.names
    }
    if not by_frame or given.table is None:
        raise FileError(path, f"has no image that is named in {given.source}")
    numbers = sorted(by_frame)
    return ImageFiles(
        tuple(by_frame[number] for number in numbers),
        tuple(numbers),
        tuple(given.table[number] for number in numbers),
    )
