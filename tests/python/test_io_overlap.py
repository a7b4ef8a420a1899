"""Boxes of one image that show the same thing."""

import numpy as np
import pytest

from dqslam.io import Notes, read_detections

HEADER = "frame,timestamp,x1,y1,x2,y2,score,class_id\n"
# Intersection over union with the first: 1, 0.8, 0.6, 0.
BOXES = ((0, 0, 100, 100), (0, 0, 100, 80), (0, 0, 100, 60), (200, 0, 300, 100))


def boxes(tmp_path, scores, frames=3, classes=(0, 1, 2, 3)):
    rows = [
        f"{frame},{frame},{','.join(map(str, box))},{score},{number}"
        for frame in range(frames)
        for box, score, number in zip(BOXES, scores, classes, strict=True)
    ]
    path = tmp_path / "boxes.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize(
    ("scores", "iou", "kept"),
    [
        ((0.9, 0.8, 0.7, 0.6), 0.5, [0, 3]),
        ((0.9, 0.8, 0.7, 0.6), 0.7, [0, 2, 3]),
        ((0.9, 0.8, 0.7, 0.6), 0.9, [0, 1, 2, 3]),
        # The first overlaps the second, which is gone because of the third.
        ((0.7, 0.8, 0.9, 0.6), 0.7, [0, 2, 3]),
        ((0.5, 0.5, 0.5, 0.5), 0.5, [0, 3]),
    ],
)
def test_the_best_of_those_that_overlap_stays(tmp_path, scores, iou, kept):
    notes = Notes()
    table = read_detections(boxes(tmp_path, scores), nms=iou, notes=notes)
    assert table.class_id.tolist() == kept * 3
    assert sum(left.count for left in notes.left_out) == 12 - 3 * len(kept)


def brute_force(box, score, iou):
    kept = []
    for row in np.argsort(-score, kind="stable"):
        for other in kept:
            low, high = (
                np.maximum(box[row, :2], box[other, :2]),
                np.minimum(box[row, 2:], box[other, 2:]),
            )
            both = np.prod(np.clip(high - low, 0, None))
            union = sum(np.prod(box[i, 2:] - box[i, :2]) for i in (row, other)) - both
            if both / union >= iou:
                break
        else:
            kept.append(row)
    return sorted(kept)


def test_as_one_image_after_the_other_would(tmp_path):
    random = np.random.default_rng(3)
    low = random.uniform(0, 60, (200, 2))
    box = np.hstack([low, low + random.uniform(20, 60, (200, 2))]).round(3)
    score = random.permutation(200) / 200
    frame = random.integers(0, 8, 200)
    rows = [
        f"{f},{f},{','.join(map(repr, b))},{s!r},{i}"
        for i, (f, b, s) in enumerate(
            zip(frame.tolist(), box.tolist(), score.tolist(), strict=True)
        )
    ]
    (tmp_path / "boxes.csv").write_text(HEADER + "\n".join(rows) + "\n")
    table = read_detections(tmp_path / "boxes.csv", nms=0.4, notes=Notes())
    expected = [
        rows[i]
        for f in range(8)
        for rows in [np.flatnonzero(frame == f)]
        for i in brute_force(box[rows], score[rows], 0.4)
    ]
    assert sorted(table.class_id.tolist()) == sorted(int(row) for row in expected)
    assert 20 < len(table) < 180


def test_many_doubles_are_noted(tmp_path):
    notes = Notes()
    read_detections(boxes(tmp_path, (0.9, 0.8, 0.7, 0.6), frames=6), notes=notes)
    assert "6 of 24 boxes overlap a better one" in notes.sentences()[0]
    assert "--nms 0.5" in notes.sentences()[0]
    notes = Notes()
    read_detections(boxes(tmp_path, (0.9, 0.3, 0.7, 0.6), frames=6), min_score=0.5, notes=notes)
    assert notes.sentences() == []  # the doubles do not count
    with pytest.raises(ValueError, match="nms is 0, not between 0 and 1"):
        read_detections(boxes(tmp_path, (1, 1, 1, 1)), nms=0)
