"""The boxes of a detector."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam._checks import (
    Bools,
    Floats,
    Ints,
    as_directions,
    as_floats,
    as_ints,
    assign,
    reject_large,
    reject_rows,
)
from dqslam._core import Camera
from dqslam._limits import LARGEST_ID, LARGEST_PIXEL
from dqslam._repr import counted
from dqslam.lens import undistort_boxes
from dqslam.recording.detectors import DetectedBoxes, read_supervision, read_ultralytics

# Detectors count pixels from the corner of the image, we from the center of the first one.
_CORNER = 0.5


@dataclass(frozen=True, eq=False)
class Detections:
    """The boxes of a detector, one row each."""

    pose: Ints
    """Row of the pose from which it was observed, shape (m,)."""
    box: Floats
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (m, 4)."""
    score: Floats
    """Confidence of the detector, shape (m,)."""
    class_id: Ints
    """Shape (m,)."""
    object_id: Ints
    """Id of the object that it shows, -1 if unknown; shape (m,)."""
    class_names: dict[int, str] = field(default_factory=dict)
    """Name of every class id that occurs."""
    truncated: Bools = field(default_factory=lambda: np.zeros((0, 4), dtype=np.bool_))
    """Whether the object may go on beyond each edge, which the border of the image or something
    nearer cuts, shape (m, 4); by default none is."""
    other_class_id: Ints = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    """Other classes that the detector thinks possible, -1 for none, shape (m, k); by default k is
    0."""
    other_score: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    """Confidence in each of them, from 0, shape (m, k)."""
    embedding: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    """What each box looks like, as a vector whose direction counts, shape (m, e); by default e is
    0."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        box = as_floats("detections.box", self.box, [None, 4])
        reject_large("detections.box", box, LARGEST_PIXEL, "px")
        reject_rows("detections.box", box[:, :2] >= box[:, 2:], "inverted or empty box", box)
        count = len(box)
        class_id = as_ints("detections.class_id", self.class_id, count)
        unnamed = ~np.isin(class_id, list(self.class_names))
        reject_rows("detections.class_id", unnamed, "class has no name", class_id)
        object_id = as_ints("detections.object_id", self.object_id, count)
        wrong = (object_id < -1) | (object_id > LARGEST_ID)
        reject_rows("detections.object_id", wrong, "not an object id", object_id)
        assign(
            self,
            pose=as_ints("detections.pose", self.pose, count),
            box=box,
            score=as_floats("detections.score", self.score, [count]),
            class_id=class_id,
            object_id=object_id,
            truncated=_as_edges("detections.truncated", self.truncated, count),
            embedding=as_directions("detections.embedding", self.embedding, count),
        )
        self._check_other_classes(count)

    @classmethod
    def from_xyxy(
        cls,
        pose: ArrayLike,
        xyxy: ArrayLike,
        *,
        object_id: ArrayLike | None = None,
        class_id: ArrayLike | None = None,
        class_names: Mapping[int, str] | Sequence[str] | None = None,
        score: ArrayLike | None = None,
        other_class_id: ArrayLike | None = None,
        other_score: ArrayLike | None = None,
        embedding: ArrayLike | None = None,
        camera: Camera | None = None,
    ) -> Self:
        """Make detections from corners in pixels that are counted from the corner of the image.

        In these pixels, an image spans 0 to its width. In ``box`` it spans -0.5 to width - 0.5.

        Parameters
        ----------
        pose
            Row of the pose from which each box was observed, shape (m,), or one number for all.
        xyxy
            [x_min, y_min, x_max, y_max], shape (m, 4).
        object_id
            Id of the object that each box shows, shape (m,), by default unknown. ``associate``
            finds unknown ones.
        class_id, class_names
            Number of each class, shape (m,), and the names of the numbers. Without names, the
            number is the name. Without both, all boxes are of the class "object".
        score
            Confidence of the detector, shape (m,), by default 1.
        other_class_id, other_score
            Other classes that the detector thinks possible, -1 for none, and its confidence in each
            of them, shapes (m, k).
        embedding
            What each box looks like, as a vector whose direction counts, shape (m, e).
        camera
            If given, boxes are in distorted pixels of this camera and are undistorted.

        Examples
        --------
        Two boxes in the image at pose 0, one in the image at pose 1:

        >>> import dqslam as dq
        >>> xyxy = [[100, 80, 181, 190], [300, 120, 420, 260], [103, 80, 184, 191]]
        >>> names = ["cup", "book"]
        >>> dq.Detections.from_xyxy([0, 0, 1], xyxy, class_id=[0, 1, 0], class_names=names)
        Detections(3 boxes without ids, 2 classes)
        """
        box = as_floats("xyxy", xyxy, [None, 4]) - _CORNER
        count = len(box)
        numbers = np.zeros(count, dtype=np.int64)
        if class_id is not None:
            numbers = as_ints("class_id", _each(class_id, count), count)
        if class_names is None:
            unnamed = class_id is None
            others = [] if other_class_id is None else np.asarray(other_class_id).ravel().tolist()
            known = {*numbers.tolist(), *(one for one in others if one >= 0)}
            names = {i: "object" if unnamed else str(i) for i in sorted(known)}
        elif isinstance(class_names, Mapping):
            names = dict(class_names)
        else:
            names = dict(enumerate(class_names))
        return cls(
            pose=as_ints("pose", _each(pose, count), count),
            box=box if camera is None else undistort_boxes(camera, box),
            score=as_floats("score", _each(1.0 if score is None else score, count), [count]),
            class_id=numbers,
            object_id=as_ints(
                "object_id", _each(-1 if object_id is None else object_id, count), count
            ),
            class_names=names,
            other_class_id=_table(other_class_id, np.int64),
            other_score=_table(other_score, np.float64),
            embedding=_table(embedding, np.float64),
        )

    @classmethod
    def from_supervision(
        cls,
        images: Iterable[Any],
        *,
        pose: ArrayLike | None = None,
        camera: Camera | None = None,
    ) -> Self:
        """Make detections from those of the library supervision, one ``sv.Detections`` per image.

        Confidence, class and the ids of a tracker are used if they exist.

        Parameters
        ----------
        images
            One ``supervision.Detections`` per image, including empty ones.
        pose
            Row of the pose at which each image was taken; by default the first image belongs to
            the first pose, and so on.
        camera
            If given, boxes are in distorted pixels of this camera and are undistorted.
        """
        return cls._from_detector(read_supervision(images), pose, camera)

    @classmethod
    def from_ultralytics(
        cls,
        images: Iterable[Any],
        *,
        pose: ArrayLike | None = None,
        camera: Camera | None = None,
    ) -> Self:
        """Make detections from Ultralytics' ``predict`` or ``track``, one ``Results`` per image.

        The ids of ``track`` are used if they exist. Parameters are those of ``from_supervision``.
        """
        return cls._from_detector(read_ultralytics(images), pose, camera)

    @classmethod
    def _from_detector(
        cls, found: DetectedBoxes, pose: ArrayLike | None, camera: Camera | None
    ) -> Self:
        rows = np.arange(found.images) if pose is None else as_ints("pose", pose, found.images)
        return cls.from_xyxy(
            rows[found.image],
            found.xyxy,
            object_id=found.object_id,
            class_id=found.class_id,
            class_names=found.class_names,
            score=found.score,
            camera=camera,
        )

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.box)

    def __repr__(self) -> str:
        """Show how many boxes, objects and classes there are."""
        return f"Detections({in_words(self)})"

    def select(self, rows: Ints | Bools) -> Self:
        """Return some of the boxes: their rows, or a flag for each box (m,)."""
        names = ["pose", "box", "score", "class_id", "object_id", "truncated"]
        names += ["other_class_id", "other_score", "embedding"]
        return replace(self, **{name: getattr(self, name)[rows] for name in names})

    def _check_other_classes(self, count: int) -> None:
        """Check and set the other classes of boxes and their scores."""
        given = np.asarray(self.other_class_id)
        shape = given.shape if given.size else (count, 0)
        if len(shape) != 2 or shape[0] != count:
            raise ValueError(
                f"detections.other_class_id: expected shape ({count}, k), got {given.shape}"
            )
        numbers = np.zeros(shape, dtype=np.int64)
        for column, values in enumerate(given.T if shape[1] else ()):
            numbers[:, column] = as_ints("detections.other_class_id", values, count)
        wrong = (numbers != -1) & ~np.isin(numbers, list(self.class_names))
        reject_rows("detections.other_class_id", wrong, "class has no name", numbers)
        twice = (numbers != -1) & (numbers == self.class_id[:, None])
        reject_rows("detections.other_class_id", twice, "the class of the box again", numbers)
        score = as_floats("detections.other_score", self.other_score, [None, None])
        if not score.size and not shape[1]:
            score = np.zeros(shape)
        if score.shape != shape:
            raise ValueError(f"detections.other_score: expected shape {shape}, got {score.shape}")
        reject_rows("detections.other_score", score < 0, "negative", score)
        assign(self, other_class_id=numbers, other_score=score)


def in_words(boxes: Detections) -> str:
    """Say how many boxes there are, of how many objects and classes."""
    count, known = counted(len(boxes), "box"), boxes.object_id >= 0
    if not len(boxes):
        return count
    classes = counted(len(np.unique(boxes.class_id)), "class")
    if not known.any():
        return f"{count} without ids, {classes}"
    objects = counted(len(np.unique(boxes.object_id[known])), "object")
    unknown = "" if known.all() else f", {np.sum(~known)} without id"
    return f"{count} of {objects}{unknown}, {classes}"


def _each(values: ArrayLike, count: int) -> ArrayLike:
    """Repeat a single number for each of the rows."""
    return np.full(count, values) if np.ndim(values) == 0 else values


def _table(values: ArrayLike | None, kind: type) -> NDArray[Any]:
    """Return a table of numbers (m, k), by default an empty one."""
    return np.zeros((0, 0), dtype=kind) if values is None else np.asarray(values)


def _as_edges(name: str, values: ArrayLike, count: int) -> Bools:
    """Return read-only flags of the four edges of each box, shape (count, 4); none by default."""
    flags = np.array(values)
    if not flags.size:
        flags = np.zeros((count, 4), dtype=np.bool_)
    if flags.shape != (count, 4):
        raise ValueError(f"{name}: expected shape ({count}, 4), got {flags.shape}")
    reject_rows(name, ~np.isin(flags, [0, 1]), "not true or false", flags)
    edges = flags.astype(np.bool_)
    edges.setflags(write=False)
    return edges
