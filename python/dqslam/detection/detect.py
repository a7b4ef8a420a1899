"""Run a detector over images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dqslam._checks import Ints
from dqslam.detection.boxes import Boxes, suppress_by_class
from dqslam.detection.frames import Frame, find_frames
from dqslam.detection.model import Model, load_model
from dqslam.io.files import FileError
from dqslam.io.frames import FrameTimes

MIN_SCORE = 0.1
CLASS_NMS = 0.65


@dataclass(frozen=True, kw_only=True)
class DetectOptions:
    """How a detector is run.

    ``layout`` is the name of one of LAYOUTS, by default recognized; ``model_size`` width and height
    of the input, px, for a model that leaves them open; ``min_score`` the least score, 0 to 1, and
    ``class_nms`` the most intersection over union, 0 to 1, of two boxes of one class, which does
    not apply to models that leave out doubles themselves; ``names`` of the classes by number, by
    default those of the model's metadata; ``frames`` times of the images, by default those of their
    names or of the film; ``every`` so many images are looked at, 1 for all; ``threads`` by default
    as many as there are cores.
    """

    layout: str | None = None
    model_size: tuple[int, int] | None = None
    min_score: float = MIN_SCORE
    class_nms: float = CLASS_NMS
    names: dict[int, str] | None = None
    frames: FrameTimes | None = None
    every: int = 1
    threads: int | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, share in (("min_score", self.min_score), ("class_nms", self.class_nms)):
            if not 0 < share <= 1:
                raise ValueError(f"{name} is {share:g}, not above 0 and at most 1")
        if self.every < 1:
            raise ValueError(f"every is {self.every}, not 1 or more")


@dataclass
class Found:
    """The boxes of all images, in the order of the images.

    ``frame`` (k,) number, ``time`` (k,) s or empty, and ``name`` (k,) of each image; ``boxes`` (k,)
    of each image, px from its corner; ``size`` (width, height) px of the images; ``names`` of the
    classes, empty if nothing tells them; ``layout`` of the model.
    """

    layout: str
    names: dict[int, str]
    size: tuple[int, int] = (0, 0)
    frame: list[int] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    name: list[str] = field(default_factory=list)
    boxes: list[Boxes] = field(default_factory=list)

    def __len__(self) -> int:
        """Return the number of boxes."""
        return sum(map(len, self.boxes))

    def counts(self) -> dict[str, int]:
        """Return the number of boxes of each class that has any, most first."""
        ids: Ints = np.concatenate([[], *(one.class_id for one in self.boxes)]).astype(np.int64)
        classes, counts = np.unique(ids, return_counts=True)
        order = np.argsort(-counts, kind="stable")
        return {self.class_name(int(classes[row])): int(counts[row]) for row in order}

    def class_name(self, class_id: int) -> str:
        """Return the name of a class, its number if it has none."""
        return self.names.get(class_id, str(class_id))


def detect(
    images: str | Path,
    model: str | Path,
    options: DetectOptions | None = None,
    *,
    progress: Callable[[float], None] = lambda share: None,
) -> Found:
    """Find boxes in the images of a folder or a film.

    Parameters
    ----------
    images
        Folder of images of one size, or film.
    model
        The detector, an ONNX file.
    options
        How it is run.
    progress
        Called with the share of the images that is done.

    Raises
    ------
    FileError
        If an image or the model cannot be read, images differ in size, or the model has classes
        that the names do not have.
    """
    chosen = options or DetectOptions()
    frames = find_frames(images, chosen.frames)
    detector = load_model(
        model, layout=chosen.layout, size=chosen.model_size, threads=chosen.threads
    )
    found = Found(detector.layout.name, detector.names if chosen.names is None else chosen.names)
    for frame in frames.frames(chosen.every):
        _check_size(found, frame, Path(images))
        boxes = detector.boxes(frame.image, min_score=chosen.min_score)
        _check_names(detector, found.names, boxes)
        if not detector.layout.suppresses:
            boxes = suppress_by_class(boxes, chosen.class_nms)
        found.frame.append(frame.number)
        found.name.append(frame.name)
        found.boxes.append(boxes)
        if frame.time is not None:
            found.time.append(frame.time)
        progress(frame.share)
    return found


def _check_size(found: Found, frame: Frame, images: Path) -> None:
    size = (frame.image.shape[1], frame.image.shape[0])
    if not found.boxes:
        found.size = size
    elif size != found.size:
        path = images / frame.name if frame.name else images
        shown = "{} x {} px, the images before it {} x {}".format(*size, *found.size)
        raise FileError(path, f"has {shown}: one camera has images of one size")


def _check_names(detector: Model, names: dict[int, str], boxes: Boxes) -> None:
    if names and len(boxes):
        unknown = [one for one in np.unique(boxes.class_id).tolist() if one not in names]
        if unknown:
            message = f"has found an object of class {unknown[0]}, and {len(names)} classes have "
            raise FileError(detector.path, message + f"names, {min(names)} to {max(names)}")
