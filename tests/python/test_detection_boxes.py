"""Images in the input of a network and boxes back; suppression; what needs no network."""

import numpy as np
import pytest

from dqslam.detection.boxes import Boxes, suppress_by_class
from dqslam.detection.classes import KNOWN, class_names
from dqslam.detection.fit import Placement, place


@pytest.mark.parametrize(
    ("fit", "expected"),
    [
        # 359.5 rows, which Python rounds to the even 360, and 280 px of bars.
        ("letterbox", Placement((1280, 719), (640, 360), (0, 140))),
        ("corner", Placement((1280, 719), (640, 359), (0, 0))),
        ("stretch", Placement((1280, 719), (640, 640), (0, 0))),
    ],
)
def test_placement(fit, expected):
    assert place((1280, 719), (640, 640), fit) == expected


@pytest.mark.parametrize("fit", ["letterbox", "corner", "stretch"])
@pytest.mark.parametrize("image", [(1241, 376), (97, 211), (640, 640), (3, 2000)])
def test_the_image_is_carried_back_exactly(fit, image):
    """The rectangle of the resized image becomes that of the image, whatever was rounded."""
    where = place(image, (640, 448), fit)
    low = np.array(where.offset)
    corner = np.concatenate([low, low + where.resized])[None].astype(float)
    assert where.to_image(corner).tolist() == [[0, 0, *image]]
    middle = np.array([[*(low + 0.25 * np.array(where.resized)), *low]])
    np.testing.assert_allclose(where.to_image(middle)[0, :2], 0.25 * np.array(image), rtol=1e-14)
    assert (low + where.resized <= (640, 448)).all()


def test_boxes_are_cut_at_the_border():
    where = place((100, 50), (200, 200), "letterbox")
    assert where.to_image(np.array([[-10.0, 0, 220, 170]])).tolist() == [[0, 0, 100, 50]]


def plain_suppression(boxes, iou):
    """The definition, pair by pair."""
    kept = []
    for i in np.argsort(-boxes.score, kind="stable"):
        for j in kept:
            low = np.maximum(boxes.corner[i, :2], boxes.corner[j, :2])
            high = np.minimum(boxes.corner[i, 2:], boxes.corner[j, 2:])
            both = max(0.0, high[0] - low[0]) * max(0.0, high[1] - low[1])
            area = [np.prod(box[2:] - box[:2]) for box in boxes.corner[[i, j]]]
            if boxes.class_id[i] == boxes.class_id[j] and both / (sum(area) - both) > iou:
                break
        else:
            kept.append(i)
    return kept


def test_suppression_by_hand():
    """Half of each box is in the other: one third of their union."""
    corner = np.array([[0, 0, 10, 10], [5, 0, 15, 10], [5, 0, 15, 10], [40, 0, 50, 10]], float)
    boxes = Boxes(corner, np.array([0.5, 0.9, 0.3, 0.1]), np.array([0, 0, 1, 0]))
    assert suppress_by_class(boxes, 0.3).score.tolist() == [0.9, 0.3, 0.1]
    assert suppress_by_class(boxes, 0.34).score.tolist() == [0.9, 0.5, 0.3, 0.1]
    assert len(suppress_by_class(boxes.select(np.zeros(4, dtype=bool)), 0.5)) == 0


def test_suppression_is_that_of_the_definition():
    random = np.random.default_rng(3)
    low = random.uniform(0, 60, (300, 2))
    corner = np.hstack([low, low + random.uniform(5, 40, (300, 2))])
    boxes = Boxes(corner, random.integers(0, 50, 300) / 50, random.integers(0, 4, 300))
    left = suppress_by_class(boxes, 0.4)
    np.testing.assert_array_equal(left.corner, corner[plain_suppression(boxes, 0.4)])
    assert 50 < len(left) < 250


def test_classes_of_coco(tmp_path):
    """Numbers of categories are those of the data set: 90 is the toothbrush, 12 is none."""
    assert KNOWN["coco"][0] == KNOWN["coco91"][1] == "person"
    assert KNOWN["coco"][79] == KNOWN["coco91"][90] == "toothbrush"
    assert (KNOWN["coco"][41], KNOWN["coco91"][47]) == ("cup", "cup")
    assert 12 not in KNOWN["coco91"] and len(KNOWN["coco91"]) == len(KNOWN["coco"]) == 80
    own = tmp_path / "names.txt"
    own.write_text("cup\nbook\n")
    assert class_names(own) == {0: "cup", 1: "book"}
