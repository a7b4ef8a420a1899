"""Cameras from COLMAP's ``cameras.txt``: ``CAMERA_ID MODEL WIDTH HEIGHT PARAMS...``.

COLMAP counts pixels from the corner of the image, so that the first pixel's center is at 0.5. Half
a pixel is therefore subtracted from its principal point. A file must have one camera.
"""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import make_camera
from dqslam.io.files import FileError, parse_numbers, read_rows, write_text
from dqslam.io.formats import Format, Look

# Names of the parameters; f stands for both focal lengths, and k4 k5 k6 must be zero.
MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": (*("fx", "fy", "cx", "cy"), *("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
}
RATIONAL = ("k4", "k5", "k6")


def read_colmap(path: str | Path) -> _core.Camera:
    """Read the camera of a cameras.txt."""
    rows, lines = read_rows(path)
    if len(rows) > 1:
        message = f"holds {len(rows)} cameras, which can have one"
        raise FileError(path, message, lines[1])
    fields, line = rows[0].split(), lines[0]
    if len(fields) < 4:
        raise FileError(path, f"{len(fields)} fields, not id, model, width, height, ...", line)
    model = fields[1]
    if model not in MODELS:
        raise FileError(path, f"model is {model}; only {', '.join(MODELS)} are known", line)
    names = ("width", "height", *MODELS[model])
    if len(fields) != 2 + len(names):
        message = f"{len(fields) - 4} parameters, but {model} has {' '.join(MODELS[model])}"
        raise FileError(path, message, line)
    values = {
        name: float(parse_numbers(path, name, [cell], [line])[0])
        for name, cell in zip(names, fields[2:], strict=True)
    }
    for name in RATIONAL:
        if values.get(name, 0) != 0:
            raise FileError(
                path, f"{name} is {values[name]:g}: only k1 k2 p1 p2 k3 are known", line
            )
    focal = values.get("f", 0)
    values = {"fx": focal, "fy": focal} | values
    values |= {"cx": values["cx"] - 0.5, "cy": values["cy"] - 0.5}
    distortion = [values.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")]
    return make_camera(path, values, distortion, lambda _: line)


def write_colmap(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as PINHOLE, OPENCV, or FULL_OPENCV where there is a k3."""
    k1, k2, p1, p2, k3 = camera.distortion.tolist()
    parameters = [camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5]
    model = "PINHOLE"
    if camera.has_distortion:
        model = "FULL_OPENCV" if k3 else "OPENCV"
        parameters += [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0][: len(MODELS[model]) - 4]
    numbers = " ".join(map(repr, parameters))
    header = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n"
    write_text(path, f"{header}1 {model} {camera.width} {camera.height} {numbers}\n")


def _looks(look: Look) -> bool:
    fields = look.first.split()
    return len(fields) > 4 and fields[0].isdecimal() and fields[1].replace("_", "").isupper()


COLMAP = Format(
    "colmap",
    "its first line is CAMERA_ID MODEL WIDTH HEIGHT ...",
    _looks,
    read_colmap,
    write_colmap,
)
