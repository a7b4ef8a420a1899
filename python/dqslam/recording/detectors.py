"""Read the output of detector libraries by its attributes, without importing the libraries."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dqslam._checks import Ints


class DetectedBoxes(NamedTuple):
    """Boxes of some images, one row each; parts that a detector left out have defaults."""

    images: int
    """Number of images, including those without boxes."""
    image: Ints
    """Number of the image of each box, shape (m,)."""
    xyxy: NDArray[Any]
    """Corners in pixels from the corner of the image, shape (m, 4)."""
    score: NDArray[Any]
    """Shape (m,)."""
    class_id: NDArray[Any]
    """Shape (m,)."""
    object_id: NDArray[Any]
    """Ids of a tracker, -1 for none, shape (m,)."""
    class_names: dict[int, str]
    """Name of each class id that occurs."""


class _Image(NamedTuple):
    """The output of a detector for one image; parts that it does not have are None."""

    xyxy: object
    score: object
    class_id: object
    object_id: object
    class_name: Iterable[object] | None
    """One per box."""


def read_supervision(images: Iterable[Any]) -> DetectedBoxes:
    """Read one ``supervision.Detections`` per image."""
    return _collect(_supervision_image(row, image) for row, image in enumerate(_several(images)))


def read_ultralytics(images: Iterable[Any]) -> DetectedBoxes:
    """Read one ``ultralytics.engine.results.Results`` per image."""
    return _collect(_ultralytics_image(row, image) for row, image in enumerate(_several(images)))


def _supervision_image(row: int, image: Any) -> _Image:
    if not hasattr(image, "xyxy") or not hasattr(image, "tracker_id"):
        raise TypeError(f"image {row}: expected supervision.Detections, got {_kind(image)}")
    names = image.data.get("class_name")
    return _Image(image.xyxy, image.confidence, image.class_id, image.tracker_id, names)


def _ultralytics_image(row: int, image: Any) -> _Image:
    if not hasattr(image, "boxes") or not hasattr(image, "names"):
        raise TypeError(f"image {row}: expected Ultralytics' Results, got {_kind(image)}")
    boxes = image.boxes
    if boxes is None:
        raise ValueError(f"image {row}: the model gave no upright boxes")
    classes = _array(boxes.cls).astype(np.int64)
    names = [image.names[number] for number in classes.tolist()]
    return _Image(boxes.xyxy, boxes.conf, classes, boxes.id, names)


def _several(images: Iterable[Any]) -> Iterable[Any]:
    """Refuse the result of a single image, which libraries let one iterate over as well."""
    if hasattr(images, "xyxy") or hasattr(images, "boxes"):
        raise TypeError(f"expected one result per image in a list, got a {_kind(images)} alone")
    return images


def _collect(images: Iterator[_Image]) -> DetectedBoxes:
    none = np.zeros(0, dtype=np.int64)
    tables = [(none, np.zeros((0, 4)), none, none, none)]
    class_names: dict[int, str] = {}
    for row, image in enumerate(images):
        xyxy = _array(image.xyxy)
        count = len(xyxy)
        class_id = _array_or(0, image.class_id, count)
        score, object_id = _array_or(1.0, image.score, count), _array_or(-1, image.object_id, count)
        _note_names(row, class_names, class_id, image)
        tables.append((np.full(count, row), xyxy, score, class_id, object_id))
    rows, xyxy, score, class_id, object_id = map(np.concatenate, zip(*tables, strict=True))
    return DetectedBoxes(len(tables) - 1, rows, xyxy, score, class_id, object_id, class_names)


def _note_names(row: int, class_names: dict[int, str], class_id: Ints, image: _Image) -> None:
    """Note the names of classes, which have to be the same in all images."""
    if image.class_name is not None:
        names = [str(name) for name in image.class_name]
    elif image.class_id is not None:
        names = [str(int(number)) for number in class_id]
    else:
        names = ["object"] * len(class_id)
    for number, name in zip(class_id.tolist(), names, strict=True):
        known = class_names.setdefault(int(number), name)
        if known != name:
            raise ValueError(f"image {row}: class {number} is called {name!r}, before {known!r}")


def _array_or(default: float, values: object, count: int) -> NDArray[Any]:
    return np.full(count, default) if values is None else _array(values)


def _array(values: Any) -> NDArray[Any]:
    """Return an array, or a tensor that may be on a graphics card, as an array."""
    return np.asarray(values.cpu().numpy() if hasattr(values, "cpu") else values)


def _kind(value: object) -> str:
    return type(value).__name__
