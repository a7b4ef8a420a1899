"""Boxes from detectors' own results: stand-ins with the attributes that the libraries document."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from dqslam import Camera, Detections
from dqslam.lens import undistort_boxes

LENS = Camera(500.0, 500.0, 319.5, 239.5, 640, 480, distortion=[-0.3, 0.1, 0.0, 0.0, 0.0])


class Tensor:
    """An array that is on a graphics card: no NumPy before it has been copied."""

    def __init__(self, values):
        self.values = np.array(values, dtype=np.float32)

    def cpu(self):
        return self

    def numpy(self):
        return self.values

    def __array__(self, *args, **kwargs):
        raise TypeError("can't convert cuda:0 device type tensor to numpy")


@dataclass
class Supervision:
    """``supervision.Detections``."""

    xyxy: np.ndarray
    confidence: np.ndarray | None = None
    class_id: np.ndarray | None = None
    tracker_id: np.ndarray | None = None
    data: dict[str, Any] = field(default_factory=dict)


@dataclass
class Boxes:
    """``ultralytics.engine.results.Boxes``."""

    xyxy: Tensor
    conf: Tensor
    cls: Tensor
    id: Tensor | None = None


@dataclass
class Results:
    """``ultralytics.engine.results.Results``."""

    boxes: Boxes | None
    names: dict[int, str]


TWO = [[0.0, 0.0, 10.5, 20.0], [100.25, 50.0, 160.0, 90.0]]
ONE = [[101.0, 51.0, 161.0, 91.0]]
NAMES = {0: "person", 41: "cup", 73: "book"}


def supervision_images(**changes):
    first = {
        "xyxy": np.array(TWO, dtype=np.float32),
        "confidence": np.array([0.5, 0.75], dtype=np.float32),
        "class_id": np.array([41, 73]),
        "tracker_id": np.array([6, 2]),
        "data": {"class_name": np.array(["cup", "book"])},
    }
    third = {"xyxy": np.array(ONE), "confidence": np.array([0.25]), "class_id": np.array([73])}
    return [
        Supervision(**first | changes),
        Supervision(xyxy=np.zeros((0, 4), dtype=np.float32)),
        Supervision(**third, data={"class_name": np.array(["book"])}),
    ]


def ultralytics_images(**changes):
    first = {
        "xyxy": Tensor(TWO),
        "conf": Tensor([0.5, 0.75]),
        "cls": Tensor([41, 73]),
        "id": Tensor([6, 2]),
    }
    empty = Boxes(Tensor(np.zeros((0, 4))), Tensor([]), Tensor([]))
    third = Boxes(Tensor(ONE), Tensor([0.25]), Tensor([73]))
    return [Results(boxes, NAMES) for boxes in (Boxes(**first | changes), empty, third)]


@pytest.mark.parametrize(
    ("read", "images"),
    [
        (Detections.from_supervision, supervision_images()),
        (Detections.from_ultralytics, ultralytics_images()),
    ],
)
def test_results_of_libraries(read, images):
    for given in (images, iter(images)):  # a model may give them one by one
        found = read(given)
        assert found.pose.tolist() == [0, 0, 2]
        # Their image begins at 0, ours at -0.5.
        np.testing.assert_array_equal(found.box, np.array([*TWO, *ONE]) - 0.5)
        assert found.score.tolist() == [0.5, 0.75, 0.25]
        assert found.class_id.tolist() == [41, 73, 73]
        assert found.object_id.tolist() == [6, 2, -1]
        assert found.class_names == {41: "cup", 73: "book"}
    assert read(images, pose=[3, 4, 8]).pose.tolist() == [3, 3, 8]
    with pytest.raises(ValueError, match=r"^pose: expected shape \(3\), got \(2,\)"):
        read(images, pose=[3, 4])
    undistorted = read(images, camera=LENS).box
    np.testing.assert_array_equal(undistorted, undistort_boxes(LENS, found.box))
    assert np.abs(undistorted - found.box).max() > 1.0


def test_what_supervision_may_leave_out():
    images = [Supervision(np.array(TWO)), Supervision(np.array(ONE), class_id=np.array([5]))]
    found = Detections.from_supervision(images[:1])
    assert found.score.tolist() == [1.0, 1.0]
    assert found.class_names == {0: "object"}
    assert found.object_id.tolist() == [-1, -1]
    found = Detections.from_supervision(images)
    assert found.class_names == {0: "object", 5: "5"}


def test_no_images_and_no_boxes():
    assert len(Detections.from_supervision([])) == 0
    assert len(Detections.from_ultralytics(ultralytics_images()[1:2])) == 0


@pytest.mark.parametrize(
    ("read", "images", "error", "message"),
    [
        (
            Detections.from_supervision,
            supervision_images()[0],
            TypeError,
            "expected one result per image in a list, got a Supervision alone",
        ),
        (
            Detections.from_ultralytics,
            ultralytics_images()[0],
            TypeError,
            "expected one result per image in a list, got a Results alone",
        ),
        (
            Detections.from_supervision,
            ultralytics_images(),
            TypeError,
            "image 0: expected supervision.Detections, got Results",
        ),
        (
            Detections.from_ultralytics,
            [*ultralytics_images(), *supervision_images()],
            TypeError,
            "image 3: expected Ultralytics' Results, got Supervision",
        ),
        (
            Detections.from_ultralytics,
            [Results(None, NAMES)],
            ValueError,
            "image 0: the model gave no upright boxes",
        ),
        (
            Detections.from_supervision,
            supervision_images(data={"class_name": np.array(["cup", "mug"])}),
            ValueError,
            "image 2: class 73 is called 'book', before 'mug'",
        ),
        (
            Detections.from_supervision,
            supervision_images(xyxy=np.array([TWO[0], [9.0, 9.0, 9.0, 20.0]])),
            ValueError,
            r"detections.box row 1: inverted or empty box: \[8.5, 8.5, 8.5, 19.5\]",
        ),
    ],
)
def test_what_is_no_result(read, images, error, message):
    with pytest.raises(error, match=f"^{message}$"):
        read(images)
