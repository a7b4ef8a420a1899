"""Each layout of outputs, from models that say the same of every image, to the pixel."""

import numpy as np
import pytest

from dqslam.detection.model import load_model
from dqslam.io import FileError
from onnx_models import onnx, save_constant

WIDTH, HEIGHT = 640, 480  # of the models' input
IMAGE = np.zeros((240, 400, 3), dtype=np.uint8)
# Letterboxed by 1.6 into 640 x 384, with 48 px above: a box of the input, and that of the image.
INPUT = np.array([64.0, 80.0, 320.0, 208.0])
IN_IMAGE = [40.0, 20.0, 200.0, 100.0]
# In the upper left corner: as above without the bar. Stretched: by 1.6 and 2.
IN_CORNER = [40.0, 50.0, 200.0, 130.0]
IN_STRETCHED = [40.0, 40.0, 200.0, 104.0]
CELLS = 80 * 60 + 40 * 30 + 20 * 15
CLASSES = 3
CENTER_AND_SIZE = np.array([192.0, 144.0, 256.0, 128.0])
AS_SHARES = CENTER_AND_SIZE / [WIDTH, HEIGHT, WIDTH, HEIGHT]


def filled(rows, columns, row, values, rest=0.0):
    table = np.full((1, rows, columns), rest, dtype=np.float32)
    table[0, row] = values
    return table


def logit(share):
    return np.log(share / (1 - share))


def yolox_raw():
    """The box in the cells of 32 px: its center, 6 by 4.5 cells, is in the cell 6, 4."""
    row = 80 * 60 + 40 * 30 + 4 * 20 + 6
    return filled(CELLS, 8, row, [0, 0.5, np.log(8), np.log(4), 0.8, 0, 1, 0.5])


def queries():
    logits = np.full((1, 20, CLASSES), -10.0, dtype=np.float32)
    logits[0, 7] = [-10, logit(0.8), logit(0.6)]  # two classes of one query: both are pairs
    return filled(20, 4, 7, AS_SHARES, 0.1), logits


BOXES, LOGITS = queries()
FOUND = filled(20, 4, 3, INPUT), filled(1, 20, 0, np.eye(20)[3] * 0.8)[0], np.ones((1, 20), "int64")
CASES = {
    "yolov5": (
        {"output0": filled(3 * CELLS, 8, 100, [*CENTER_AND_SIZE, 0.8, 0, 1, 0.5])},
        IN_IMAGE,
    ),
    "yolov8": (
        {"output0": filled(CELLS, 7, 100, [*CENTER_AND_SIZE, 0, 0.8, 0.4]).transpose(0, 2, 1)},
        IN_IMAGE,
    ),
    "yolox": ({"output": yolox_raw()}, IN_CORNER),
    "yolox-decoded": (
        {"output": filled(CELLS, 8, 100, [*(CENTER_AND_SIZE + [200, 0, 0, 0]), 0.8, 0, 1, 0.5])},
        [165.0, 50.0, 325.0, 130.0],
    ),
    "end-to-end": ({"output0": filled(300, 6, 2, [*INPUT, 0.8, 1])}, IN_IMAGE),
    "rtdetr": ({"labels": FOUND[2], "boxes": FOUND[0], "scores": FOUND[1]}, IN_STRETCHED),
    "detr": ({"logits": LOGITS, "pred_boxes": BOXES}, IN_STRETCHED),
    "rfdetr": ({"dets": BOXES, "labels": LOGITS}, IN_STRETCHED),
    "rtdetr-ultralytics": (
        {"output0": filled(300, 7, 9, [*AS_SHARES, 0, 0.8, 0.1])},
        IN_STRETCHED,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_recognized_and_decoded(name, tmp_path):
    outputs, expected = CASES[name]
    path = save_constant(tmp_path / "model.onnx", outputs, sized=name == "rtdetr")
    model = load_model(path)
    assert model.layout.name == name
    found = model.boxes(IMAGE, min_score=0.7)
    np.testing.assert_allclose(found.corner, [expected], atol=2e-5)
    assert found.class_id.tolist() == [1]
    np.testing.assert_allclose(found.score, [0.8], atol=1e-6)


def test_pairs_of_query_and_class(tmp_path):
    """The second class of a query is a box of its own, as its authors' own code has it."""
    path = save_constant(tmp_path / "model.onnx", CASES["detr"][0])
    found = load_model(path).boxes(IMAGE, min_score=0.5)
    assert found.class_id.tolist() == [1, 2]
    np.testing.assert_allclose(found.score, [0.8, 0.6], atol=1e-6)


def test_coefficients_of_masks_are_no_classes(tmp_path):
    columns = [*CENTER_AND_SIZE, 0, 0.8, 0.4, *[5.0] * 32]
    outputs = {
        "output0": filled(CELLS, 39, 100, columns).transpose(0, 2, 1),
        "output1": np.zeros((1, 32, 120, 160), dtype=np.float32),
    }
    model = load_model(save_constant(tmp_path / "model.onnx", outputs))
    found = model.boxes(IMAGE, min_score=0.7)
    assert model.layout.name == "yolov8"
    assert (found.class_id.tolist(), round(float(found.score[0]), 6)) == ([1], 0.8)


def test_names_of_the_metadata(tmp_path):
    metadata = {"names": "{0: 'cup', 1: 'book'}", "imgsz": "[480, 640]"}
    path = save_constant(tmp_path / "model.onnx", CASES["yolov8"][0], metadata=metadata)
    assert load_model(path).names == {0: "cup", 1: "book"}
    path = save_constant(tmp_path / "bad.onnx", CASES["yolov8"][0], metadata={"names": "{0: "})
    with pytest.raises(FileError, match=r"bad\.onnx: the names of classes .* cannot be read"):
        load_model(path)


def test_size_that_the_file_leaves_open(tmp_path):
    """The size comes from the user, from the metadata, or is 640 x 640."""
    nodes = {"height": "h", "width": "w"}
    square = 80 * 80 + 40 * 40 + 20 * 20
    outputs = {"output0": np.zeros((1, 7, square), dtype=np.float32)}
    path = save_constant(tmp_path / "model.onnx", outputs, **nodes)
    assert load_model(path).size == (640, 640)
    path = save_constant(
        tmp_path / "own.onnx", CASES["yolov8"][0], metadata={"imgsz": "[480, 640]"}, **nodes
    )
    assert load_model(path).size == (640, 480)
    assert load_model(path, size=(480, 640)).size == (480, 640)
    fixed = save_constant(tmp_path / "fixed.onnx", CASES["yolov8"][0])
    with pytest.raises(FileError, match="takes images of width 640, not 320"):
        load_model(fixed, size=(320, 480))


def test_unknown_outputs(tmp_path):
    outputs = {"features": np.zeros((1, 1280), dtype=np.float32)}
    path = save_constant(tmp_path / "model.onnx", outputs)
    with pytest.raises(FileError, match=r"features \(1, 1280\), are in none of the known layouts"):
        load_model(path)
    with pytest.raises(FileError, match=r"are not of the layout yolov8, \(1, 4 \+ classes, cells"):
        load_model(path, layout="yolov8").boxes(IMAGE, min_score=0.5)
    with pytest.raises(ValueError, match="no layout is called yolo; there are rtdetr, detr"):
        load_model(path, layout="yolo")


def test_files_that_are_no_detectors(tmp_path):
    nonsense = tmp_path / "model.onnx"
    nonsense.write_bytes(b"nothing of the kind")
    with pytest.raises(FileError, match=r"model\.onnx: is no model that ONNX Runtime can load"):
        load_model(nonsense)
    with pytest.raises(FileError, match="none.onnx: no such file"):
        load_model(tmp_path / "none.onnx")
    whole = save_constant(tmp_path / "whole.onnx", CASES["yolov8"][0], kind=onnx.TensorProto.INT64)
    with pytest.raises(
        FileError, match=r"its input images is 1 x 3 x 480 x 640 of tensor\(int64\)"
    ):
        load_model(whole)


def test_numbers_that_are_none_are_left_out(tmp_path):
    outputs = {"output0": filled(300, 6, 2, [np.nan, 80, 320, 208, 0.8, 1])}
    outputs["output0"][0, 4] = [64, 80, 320, 208, np.nan, 1]
    outputs["output0"][0, 5] = [700, 80, 900, 208, 0.9, 1]  # beside the image
    model = load_model(save_constant(tmp_path / "model.onnx", outputs))
    assert len(model.boxes(IMAGE, min_score=0.5)) == 0
