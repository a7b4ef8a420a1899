"""A detector in an ONNX file: its input, the layout of its outputs, the names of its classes."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats
from dqslam.detection.boxes import Boxes
from dqslam.detection.fit import fitted, place
from dqslam.detection.layouts import LAYOUTS, Layout, Outputs, Size
from dqslam.io.files import FileError

USUAL_SIDE = 640  #: of an input whose size the file leaves open
_TYPES = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
}


@dataclass(frozen=True)
class Model:
    """A detector that is ready to run.

    ``size`` (width, height) px of its input; ``names`` of its classes, from its metadata, or empty.
    """

    path: Path
    session: Any
    size: Size
    layout: Layout
    names: dict[int, str]

    def boxes(self, image: Any, *, min_score: float) -> Boxes:
        """Return the boxes of an image (h, w, 3) of blue, green, red, in px of the image.

        Boxes that are not finite, below the score, or without area in the image are not among them.
        """
        where = place((image.shape[1], image.shape[0]), self.size, self.layout.fit)
        outputs = _run(self.session, self.size, self._input(fitted(image, self.size, where)))
        try:
            found = self.layout.decode(outputs, self.size)
        except (IndexError, KeyError, ValueError) as error:
            raise FileError(self.path, _not_of(self.layout, outputs, error)) from None
        rows = np.isfinite(found.corner).all(axis=1) & (found.score >= min_score)
        found = found.select(np.flatnonzero(rows))
        found = Boxes(where.to_image(found.corner), np.minimum(found.score, 1.0), found.class_id)
        has_area = (found.corner[:, 2:] > found.corner[:, :2]).all(axis=1)
        return found.select(np.flatnonzero(has_area))

    def _input(self, canvas: Any) -> Floats:
        layout = self.layout
        planes = canvas[..., ::-1] if layout.colors == "rgb" else canvas
        if self.session.get_inputs()[0].type == "tensor(uint8)":  # it scales pixels itself
            return np.ascontiguousarray(planes.transpose(2, 0, 1)[None])
        scaled = (planes / layout.divisor - np.array(layout.mean)) / np.array(layout.sigma)
        return np.ascontiguousarray(scaled.transpose(2, 0, 1)[None])


def load_model(
    path: str | Path,
    *,
    layout: str | None = None,
    size: Size | None = None,
    threads: int | None = None,
) -> Model:
    """Load a detector.

    Parameters
    ----------
    path
        The ONNX file.
    layout
        Name of one of LAYOUTS; by default it is recognized.
    size
        Width and height of the input, px, if the file leaves them open. Default: what its metadata
        say, or 640.
    threads
        Number of threads; by default as many as there are cores.

    Raises
    ------
    FileError
        If the file is no ONNX model, takes something else than images, or has outputs in none of
        the layouts.
    """
    path = Path(path)
    if not path.is_file():
        raise FileError(path, "no such file")
    session = _session(path, threads)
    metadata = dict(session.get_modelmeta().custom_metadata_map)
    first = session.get_inputs()[0]
    _check_input(path, first)
    own = _own_size(path, first.shape[2:], metadata, size)
    outputs = _tried(path, session, own)
    chosen = _recognized(path, outputs, own) if layout is None else _named(layout)
    return Model(path, session, own, chosen, _names(path, metadata))


def _check_input(path: Path, first: Any) -> None:
    """Refuse a model that takes something else than one image of three colors."""
    shape, kind = first.shape, first.type
    if len(shape) != 4 or kind not in _TYPES or (isinstance(shape[1], int) and shape[1] != 3):
        shown = " x ".join(map(str, shape))
        message = f"its input {first.name} is {shown} of {kind}, not 1 x 3 x height x width"
        raise FileError(path, message)
    if isinstance(shape[0], int) and shape[0] != 1:
        raise FileError(path, f"takes {shape[0]} images at once; export it with a batch of 1")


def _named(layout: str) -> Layout:
    for one in LAYOUTS:
        if one.name == layout:
            return one
    names = ", ".join(one.name for one in LAYOUTS)
    raise ValueError(f"no layout is called {layout}; there are {names}")


def _recognized(path: Path, outputs: Outputs, size: Size) -> Layout:
    for one in LAYOUTS:
        if one.looks(outputs, size):
            return one
    names = ", ".join(one.name for one in LAYOUTS)
    message = f"its outputs, {_shown(outputs)}, are in none of the known layouts: {names}"
    raise FileError(path, message)


def _session(path: Path, threads: int | None) -> Any:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3  # errors only: its warnings are for those who export models
    if threads is not None:
        options.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(
            str(path), options, providers=onnxruntime.get_available_providers()
        )
    except Exception as error:  # ONNX Runtime has an exception of its own for each code
        message = " ".join(str(error).split())
        raise FileError(path, f"is no model that ONNX Runtime can load: {message}") from None


def _own_size(path: Path, sides: Any, metadata: dict[str, str], asked: Size | None) -> Size:
    """Return width and height of the input: from its shape, the user, the metadata, or usual."""
    own: list[int | None] = [side if isinstance(side, int) and side > 0 else None for side in sides]
    if asked is None:
        try:
            height, width = ast.literal_eval(metadata.get("imgsz", "[640, 640]"))
            asked = int(width), int(height)
        except (ValueError, SyntaxError, TypeError):
            asked = USUAL_SIDE, USUAL_SIDE
        asked = own[1] or asked[0], own[0] or asked[1]
    for side, fixed, wanted in (("width", own[1], asked[0]), ("height", own[0], asked[1])):
        if fixed is not None and fixed != wanted:
            raise FileError(path, f"takes images of {side} {fixed}, not {wanted}")
    return asked


def _tried(path: Path, session: Any, size: Size) -> Outputs:
    """Return what a model says of an empty image."""
    try:
        return _run(session, size, np.zeros((1, 3, size[1], size[0])))
    except Exception as error:
        message = " ".join(str(error).split())
        text = f"does not run on an image of {size[0]} x {size[1]} px: {message}"
        raise FileError(path, text) from None


def _run(session: Any, size: Size, pixels: Floats) -> Outputs:
    image, *others = session.get_inputs()
    given: dict[str, Any] = {image.name: pixels.astype(_TYPES[image.type])}
    for other in others:  # the size to which boxes are scaled: that of the input, for us to undo
        kind = np.float32 if other.type == "tensor(float)" else np.int64
        given[other.name] = np.array([size], dtype=kind)
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(None, given), strict=True))


def _names(path: Path, metadata: dict[str, str]) -> dict[int, str]:
    """Return the names of classes that Ultralytics writes: {0: 'person', 1: 'bicycle', ...}."""
    text = metadata.get("names")
    if text is None:
        return {}
    try:
        found = ast.literal_eval(text)
        pairs = found.items() if isinstance(found, dict) else enumerate(found)
        return {int(number): str(name) for number, name in pairs}
    except (ValueError, SyntaxError, TypeError):
        raise FileError(
            path, f"the names of classes in its metadata cannot be read: {text}"
        ) from None


def _shown(outputs: Outputs) -> str:
    return ", ".join(f"{name} {one.shape}" for name, one in outputs.items())


def _not_of(layout: Layout, outputs: Outputs, error: Exception) -> str:
    return (
        f"its outputs, {_shown(outputs)}, are not of the layout {layout.name}, {layout.outputs} "
        f"({error})"
    )
