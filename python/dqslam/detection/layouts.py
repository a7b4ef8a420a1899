"""Layouts of the outputs of detectors: how each is recognized, fed and decoded.

Programs that export to ONNX agree about one image per call, planes of colors, and little else. A
layout is recognized by the names and shapes of the outputs for an empty image. ``cells`` is the
number of places at which a network without anchors looks, one in each square of 8, 16 and 32 px.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam.detection.boxes import Boxes, best_class, corners_of_centers
from dqslam.detection.fit import Fit

Outputs = Mapping[str, Floats]
Size = tuple[int, int]
STRIDES = (8, 16, 32), (8, 16, 32, 64)
ANCHORS = 3  #: of YOLOv5 to YOLOv7 at each place
_IMAGENET = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


@dataclass(frozen=True)
class Layout:
    """One kind of output.

    ``decode`` gives boxes in px of the network's input, ``suppresses`` says whether the network has
    left out doubles itself. The input is ``(pixel / divisor - mean) / sigma``, in the order of
    ``colors``.
    """

    name: str
    models: str
    outputs: str
    looks: Callable[[Outputs, Size], bool]
    decode: Callable[[Outputs, Size], Boxes]
    fit: Fit = "letterbox"
    colors: str = "rgb"
    divisor: float = 255.0
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (1.0, 1.0, 1.0)
    suppresses: bool = False


def strides_of(count: int, size: Size, anchors: int = 1) -> tuple[int, ...] | None:
    """Return the strides of a network that looks at this number of places, or None."""
    for strides in STRIDES:
        if count == anchors * sum((size[0] // s) * (size[1] // s) for s in strides):
            return strides
    return None


def table_of(outputs: Outputs) -> Floats | None:
    """Return the one output of shape (1, a, b), as (a, b); None if there is not just one."""
    found = [one for one in outputs.values() if one.ndim == 3 and one.shape[0] == 1]
    return found[0][0] if len(found) == 1 else None


def _rows_of(outputs: Outputs) -> Floats:
    table = table_of(outputs)
    if table is None:
        raise ValueError("no output of shape (1, a, b), or several")
    return table.astype(float)


def _named(*names: str) -> Callable[[Outputs, Size], bool]:
    return lambda outputs, size: set(names) <= set(outputs)


def _shaped(fits: Callable[[Floats, Size], bool]) -> Callable[[Outputs, Size], bool]:
    """Recognize by the one output of shape (a, b)."""

    def looks(outputs: Outputs, size: Size) -> bool:
        table = table_of(outputs)
        return table is not None and min(table.shape) > 0 and fits(table, size)

    return looks


def _looks_yolox(table: Floats, size: Size, *, decoded: bool) -> bool:
    """Raw centers are shares of a cell, about 0 to 1; decoded ones are pixels up to the width."""
    is_yolox = table.shape[1] > 5 and strides_of(len(table), size) is not None
    return is_yolox and bool(table[:, 0].max() > 0.5 * size[0]) == decoded


def _yolov5(outputs: Outputs, size: Size) -> Boxes:
    rows = _rows_of(outputs)
    return best_class(corners_of_centers(rows[:, :4]), rows[:, 4:5] * rows[:, 5:])


def _yolov8(outputs: Outputs, size: Size) -> Boxes:
    columns = _rows_of(outputs).T
    # Models of segments have the coefficients of masks after the classes.
    masks = sum(one.shape[1] for one in outputs.values() if one.ndim == 4)
    scores = columns[:, 4 : columns.shape[1] - masks]
    return best_class(corners_of_centers(columns[:, :4]), scores)


def _yolox(outputs: Outputs, size: Size) -> Boxes:
    rows = _rows_of(outputs)
    strides = strides_of(len(rows), size)
    if strides is None:
        raise ValueError(f"{len(rows)} rows are not of an input of {size[0]} x {size[1]} px")
    corner, step = [], []
    for stride in strides:
        v, u = np.mgrid[: size[1] // stride, : size[0] // stride]
        corner.append(np.stack([u.ravel(), v.ravel()], axis=1))
        step.append(np.full((u.size, 1), float(stride)))
    stride_of_row = np.concatenate(step)
    center = (rows[:, :2] + np.concatenate(corner)) * stride_of_row
    extent = np.exp(rows[:, 2:4]) * stride_of_row
    scores = rows[:, 4:5] * rows[:, 5:]
    return best_class(corners_of_centers(np.hstack([center, extent])), scores)


def _end_to_end(outputs: Outputs, size: Size) -> Boxes:
    rows = _rows_of(outputs)
    return Boxes(rows[:, :4], rows[:, 4], np.rint(rows[:, 5]).astype(np.int64))


def _shares(outputs: Outputs, size: Size) -> Boxes:
    rows = _rows_of(outputs)
    return best_class(corners_of_centers(rows[:, :4]) * np.array(size * 2), rows[:, 4:])


def _rtdetr(outputs: Outputs, size: Size) -> Boxes:
    boxes, scores, labels = (outputs[name][0] for name in ("boxes", "scores", "labels"))
    return Boxes(boxes.astype(float), scores.astype(float), labels.astype(np.int64))


def _queries(boxes: str, logits: str) -> Callable[[Outputs, Size], Boxes]:
    """Decode queries as their authors do: the best pairs of query and class, one for each query."""

    def decode(outputs: Outputs, size: Size) -> Boxes:
        center, score = outputs[boxes][0].astype(float), _sigmoid(outputs[logits][0])
        best = np.argsort(-score, axis=None, kind="stable")[: len(score)]
        query, class_id = np.unravel_index(best, score.shape)
        corner = corners_of_centers(center)[query] * np.array(size * 2)
        return Boxes(corner, score[query, class_id], class_id.astype(np.int64))

    return decode


def _sigmoid(logits: Floats) -> Floats:
    positive = np.exp(-np.abs(logits.astype(float)))
    share: Floats = np.where(logits >= 0, 1.0, positive) / (1.0 + positive)
    return share


#: In the order in which they are tried.
LAYOUTS = (
    Layout(
        "rtdetr",
        "RT-DETR, D-FINE, DEIM, exported by their authors' scripts",
        "labels (1, n), boxes (1, n, 4) px, scores (1, n)",
        _named("labels", "boxes", "scores"),
        _rtdetr,
        fit="stretch",
        suppresses=True,
    ),
    Layout(
        "detr",
        "RT-DETR, D-FINE, exported from Hugging Face Transformers",
        "logits (1, n, classes), pred_boxes (1, n, 4) shares",
        _named("logits", "pred_boxes"),
        _queries("pred_boxes", "logits"),
        fit="stretch",
        suppresses=True,
    ),
    Layout(
        "rfdetr",
        "RF-DETR",
        "labels (1, n, classes), dets (1, n, 4) shares",
        _named("dets", "labels"),
        _queries("dets", "labels"),
        fit="stretch",
        mean=_IMAGENET[0],
        sigma=_IMAGENET[1],
        suppresses=True,
    ),
    Layout(
        "yolov5",
        "YOLOv5, YOLOv7",
        "(1, 3 cells, 5 + classes): center, size px, objectness, scores",
        _shaped(lambda t, size: t.shape[1] > 5 and strides_of(len(t), size, ANCHORS) is not None),
        _yolov5,
    ),
    Layout(
        "yolox",
        "YOLOX",
        "(1, cells, 5 + classes): center and logarithm of size in cells, objectness, scores",
        _shaped(lambda table, size: _looks_yolox(table, size, decoded=False)),
        _yolox,
        fit="corner",
        colors="bgr",
        divisor=1.0,
    ),
    Layout(
        "yolox-decoded",
        "YOLOX with --decode_in_inference",
        "(1, cells, 5 + classes): center, size px, objectness, scores",
        _shaped(lambda table, size: _looks_yolox(table, size, decoded=True)),
        _yolov5,
        fit="corner",
        colors="bgr",
        divisor=1.0,
    ),
    Layout(
        "yolov8",
        "YOLOv8, YOLOv9, YOLO11, YOLO12",
        "(1, 4 + classes, cells): center, size px, scores",
        _shaped(lambda t, size: t.shape[0] > 4 and strides_of(t.shape[1], size) is not None),
        _yolov8,
    ),
    Layout(
        "end-to-end",
        "YOLOv10, YOLO26, and YOLO exported with nms=True",
        "(1, n, 6): corners px, score, class",
        _shaped(lambda table, size: table.shape[1] == 6),
        _end_to_end,
        suppresses=True,
    ),
    Layout(
        "rtdetr-ultralytics",
        "RT-DETR, exported by Ultralytics",
        "(1, n, 4 + classes): center, size as shares, scores",
        _shaped(lambda table, size: table.shape[1] > 4 and len(table) <= 1000),
        _shares,
        fit="stretch",
        suppresses=True,
    ),
)
