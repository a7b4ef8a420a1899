"""Small ONNX models: outputs that are known, and a detector of things that have one color each."""

import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="onnx is not installed")
pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed: the extra detect")
cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed: the extra detect")

OPSET, IR = 17, 8


def _save(path, nodes, inputs, outputs, constants, metadata):
    helper, types = onnx.helper, onnx.TensorProto
    kinds = {np.dtype("float32"): types.FLOAT, np.dtype("int64"): types.INT64}
    given = [
        helper.make_tensor_value_info(name, kind, shape) for name, (kind, shape) in inputs.items()
    ]
    made = [
        helper.make_tensor_value_info(name, kinds[np.dtype(kind)], shape)
        for name, (kind, shape) in outputs.items()
    ]
    known = [onnx.numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "detector", given, made, known)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR)
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def save_constant(path, outputs, *, width=640, height=480, sized=False, metadata=None, kind=None):
    """Write a model that says the same of every image; `sized` has an input of the size, too."""
    types = onnx.TensorProto
    image = types.FLOAT if kind is None else kind
    inputs = {"images": (image, (1, 3, height, width))}
    if sized:
        inputs["orig_target_sizes"] = (types.INT64, (1, 2))
    nodes = [onnx.helper.make_node("Identity", [f"{name}_"], [name]) for name in outputs]
    described = {name: (value.dtype, value.shape) for name, value in outputs.items()}
    constants = {f"{name}_": value for name, value in outputs.items()}
    return _save(path, nodes, inputs, described, constants, metadata or {})


def save_colors(path, *, width, height, names=None):
    """Write a detector of what is painted in red, green and blue, one object for each color.

    Its output is (1, 3, 6): the corners of all pixels of a color, its score 0 or 1, its number.
    """
    make, to_float = onnx.helper.make_node, onnx.TensorProto.FLOAT
    constants = {
        "zero": np.array([0]),
        "half": np.array(0.5, dtype=np.float32),
        "number": np.arange(3, dtype=np.float32).reshape(3, 1),
        "unit": np.array(1, dtype=np.float32),
    }
    nodes = [
        make("Squeeze", ["images", "zero"], ["planes"]),
        make("Greater", ["planes", "half"], ["is"]),
        make("Cast", ["is"], ["mask"], to=to_float),
    ]
    for axis, side, low, high in ((1, "columns", "left", "right"), (2, "rows", "top", "bottom")):
        nodes += [
            make("ReduceMax", ["mask"], [side], axes=[axis], keepdims=0),
            make("ArgMax", [side], [f"{low}_"], axis=1),
            make("Cast", [f"{low}_"], [low], to=to_float),
            make("ArgMax", [side], [f"{high}_"], axis=1, select_last_index=1),
            make("Cast", [f"{high}_"], [f"{high}__"], to=to_float),
            make("Add", [f"{high}__", "unit"], [high]),
        ]
    nodes += [
        make("ReduceMax", ["columns"], ["score"], axes=[1], keepdims=1),
        make("Concat", ["left", "top", "right", "bottom", "score", "number"], ["table"], axis=1),
        make("Unsqueeze", ["table", "zero"], ["found"]),
    ]
    inputs = {"images": (to_float, (1, 3, height, width))}
    outputs = {"found": ("float32", (1, 3, 6))}
    metadata = {} if names is None else {"names": repr(dict(enumerate(names)))}
    return _save(path, nodes, inputs, outputs, constants, metadata)


def paint(boxes, *, width, height):
    """Paint rectangles, whole pixels from the corner, in red, green and blue; None for none."""
    image = np.zeros((height, width, 3), dtype=np.uint8)
    for color, box in zip((2, 1, 0), boxes, strict=False):  # as OpenCV has them
        if box is not None:
            left, top, right, bottom = box
            image[top:bottom, left:right, color] = 255
    return image


def write_image(path, image):
    """Write an image (h, w, 3) of blue, green, red without loss."""
    assert cv2.imwrite(str(path), image)
    return path
