"""The frames or the times of images, by their names: all names together tell which number counts.

``000042``, ``left_42`` and ``clip_0042_10`` (where all end in 10) are frame 42. Names that are
times in seconds (``1311868164.363181``) or whole milli-, micro- or nanoseconds since 1970 are
times.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dqslam._checks import Floats, Ints

NUMBER = re.compile(r"[0-9]+")
LONGEST = 15  #: digits of a number of a frame
SECONDS = re.compile(r"[0-9]+\.[0-9]+")
# Number of digits of the time since 1970, from 2001 to 2286, and the seconds of its last digit.
SINCE_1970 = {13: 1e-3, 16: 1e-6, 19: 1e-9}
DATE_AND_TIME = re.compile(
    r"(?<![0-9])(?:19|20)[0-9]{2}[-_.]?(?:0[1-9]|1[0-2])[-_.]?(?:0[1-9]|[12][0-9]|3[01])[-_T .]*"
    r"(?:[01][0-9]|2[0-3])[-_.:h]?[0-5][0-9](?:[-_.:m]?[0-5][0-9])?"
)
# Roboflow appends the old ending and a hash: clip_00012_jpg.rf.0a1b2c...
EXPORTED = re.compile(r"(?:[._](?:jpe?g|png|bmp|webp))?\.rf\.[0-9A-Za-z]{8,}$", re.IGNORECASE)


class ImageNameError(ValueError):
    """Names of images that do not tell their frames.

    ``row`` is the first such name, ``is_double`` whether two images are of one frame.
    """

    def __init__(self, row: int, message: str, *, is_double: bool = False) -> None:
        super().__init__(message)
        self.row, self.is_double = row, is_double


class ImageFrames(NamedTuple):
    """The frame of each image, shape (n,), and its time [s], shape (n,), if names are times."""

    frame: Ints
    time: Floats | None


def image_name(name: str) -> str:
    """Return the name of an image without folder and ending: rgb/13.25.png is 13.25."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    stem, dot, ending = last.rpartition(".")
    return stem if dot and ending.isalpha() else last


def frames_of_images(names: Sequence[str]) -> ImageFrames:
    """Find the frames or the times of images by their names, shape (n,); names may repeat.

    Frames of times are their places in the order of time.

    Raises
    ------
    ImageNameError
        If a name has no number, more than one number varies from name to name, the number is part
        of a date with a time, or two images have the same number.
    """
    row_of: dict[str, int] = {}
    for row, name in enumerate(names):
        row_of.setdefault(name, row)
    stems = [EXPORTED.sub("", image_name(name)) for name in row_of]
    rows = list(row_of.values())
    order = dict(zip(row_of, range(len(rows)), strict=True))
    back = np.array([order[name] for name in names], dtype=np.int64)
    times = _times(stems)
    if times is not None:
        _refuse_two(list(row_of), rows, times, "at")
        frame = np.argsort(np.argsort(times)).astype(np.int64)
        return ImageFrames(frame[back], np.array(times)[back])
    numbers = _numbers(stems, rows)
    _refuse_two(list(row_of), rows, numbers, "frame")
    return ImageFrames(np.array(numbers, dtype=np.int64)[back], None)


def have_times(names: Sequence[str]) -> bool:
    """Return whether all names are times."""
    return (
        bool(names) and _times([EXPORTED.sub("", image_name(name)) for name in names]) is not None
    )


def _times(stems: Sequence[str]) -> list[float] | None:
    """Return the times [s] if all names are times."""
    if all(SECONDS.fullmatch(stem) for stem in stems):
        return [float(stem) for stem in stems]
    lengths = {len(stem) for stem in stems}
    unit = SINCE_1970.get(lengths.pop()) if len(lengths) == 1 else None
    if unit is None or not all(stem.isascii() and stem.isdigit() for stem in stems):
        return None
    # Whole seconds and the rest apart, as a float of nanoseconds would lose digits.
    count = round(1 / unit)
    return [int(stem) // count + int(stem) % count * unit for stem in stems]


def _numbers(stems: Sequence[str], rows: Sequence[int]) -> list[int]:
    """Return the number of each name that varies."""
    found = [NUMBER.findall(stem) for stem in stems]
    for numbers, row in zip(found, rows, strict=True):
        if not numbers:
            raise ImageNameError(row, "its name is no number of a frame")
    places = _varying(stems, found, rows)
    chosen = [numbers[place] for numbers, place in zip(found, places, strict=True)]
    for text, row in zip(chosen, rows, strict=True):
        if len(text) > LONGEST:
            raise ImageNameError(row, f"its name is no number of a frame: {text} is too long")
    if all(map(_in_date, stems, places)):
        message = "its name has a date with a time, which is no number of a frame"
        raise ImageNameError(rows[0], message)
    return [int(text) for text in chosen]


def _varying(
    stems: Sequence[str], found: Sequence[list[str]], rows: Sequence[int]
) -> Sequence[int]:
    """Return for each name the place of the number that varies, among its numbers."""
    if all(len(numbers) == 1 for numbers in found):
        return [0] * len(found)
    texts = [tuple(NUMBER.split(stem)) for stem in stems]
    other = next((i for i, text in enumerate(texts) if text != texts[0]), None)
    if other is not None:
        message = f"which number in its name is the frame? {stems[0]!r} and {stems[other]!r} differ"
        raise ImageNameError(rows[other], message)
    varies = [place for place in range(len(found[0])) if len({row[place] for row in found}) > 1]
    if len(varies) == 1:
        return varies * len(found)
    last = stems[-1]
    where = f"from {stems[0]!r} to {last!r}" if len(stems) > 1 else f"in {last!r}"
    message = f"which number in its name is the frame? {len(varies) or len(found[0])} of them "
    raise ImageNameError(rows[0], message + ("vary " if varies else "are there ") + where)


def _in_date(stem: str, place: int) -> bool:
    number = [match.span() for match in NUMBER.finditer(stem)][place]
    dates = [match.span() for match in DATE_AND_TIME.finditer(stem)]
    return any(start <= number[0] and number[1] <= end for start, end in dates)


def _refuse_two(
    names: Sequence[str], rows: Sequence[int], values: Sequence[float], word: str
) -> None:
    """Refuse two images of one frame or time."""
    first: dict[float, int] = {}
    for i, value in enumerate(values):
        if value in first:
            message = f"two images are {word} {value:.16g}: {names[first[value]]} and {names[i]}"
            raise ImageNameError(rows[i], message, is_double=True)
        first[value] = i
