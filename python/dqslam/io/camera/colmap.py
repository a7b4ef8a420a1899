"""Cameras from COLMAP's ``cameras.txt``: ``CAMERA_ID MODEL WIDTH HEIGHT PARAMS...``.

COLMAP counts pixels from the corner of the image, so that the first pixel's center is at 0.5. Half
a pixel is therefore subtracted from its principal point. The ids are COLMAP's.
"""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import choose_camera, make_camera
from dqslam.io.camera.lenses import polynomial
from dqslam.io.files import FileError, parse_numbers, read_rows, write_text
from dqslam.io.formats import Format, Look
from dqslam.lens import PARAMETERS, Lens, lens_of

_F = ("f", "cx", "cy")  # f stands for both focal lengths
_FXY = ("fx", "fy", "cx", "cy")
# Names of the parameters of each model, and the lens model, of which others are zero.
MODELS = {
    "SIMPLE_PINHOLE": (_F, "plumb_bob"),
    "PINHOLE": (_FXY, "plumb_bob"),
    "SIMPLE_RADIAL": ((*_F, "k1"), "plumb_bob"),
    "RADIAL": ((*_F, "k1", "k2"), "plumb_bob"),
    "OPENCV": ((*_FXY, "k1", "k2", "p1", "p2"), "plumb_bob"),
    "FULL_OPENCV": ((*_FXY, *PARAMETERS["rational"]), "rational"),
    "SIMPLE_RADIAL_FISHEYE": ((*_F, "k1"), "equidistant"),
    "RADIAL_FISHEYE": ((*_F, "k1", "k2"), "equidistant"),
    "OPENCV_FISHEYE": ((*_FXY, *PARAMETERS["equidistant"]), "equidistant"),
    "FOV": ((*_FXY, *PARAMETERS["fov"]), "fov"),
    "THIN_PRISM_FISHEYE": ((*_FXY, *PARAMETERS["thin_prism_fisheye"]), "thin_prism_fisheye"),
}
_WRITTEN = {
    "rational": "FULL_OPENCV",
    "equidistant": "OPENCV_FISHEYE",
    "fov": "FOV",
    "thin_prism_fisheye": "THIN_PRISM_FISHEYE",
}


def read_colmap(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of a cameras.txt."""
    rows, lines = read_rows(path)
    cameras: dict[str, tuple[list[str], int]] = {}
    for row, line in zip(rows, lines, strict=True):
        fields = row.split()
        if len(fields) < 4:
            raise FileError(path, f"{len(fields)} fields, not id, model, width, height, ...", line)
        if fields[0] in cameras:
            raise FileError(path, f"camera {fields[0]} occurs twice", line)
        cameras[fields[0]] = (fields, line)
    return _camera(path, *choose_camera(path, cameras, camera_id))


def from_corner(values: dict[str, float]) -> dict[str, float]:
    """Return intrinsics with the principal point counted from the center of the first pixel."""
    return values | {"cx": values["cx"] - 0.5, "cy": values["cy"] - 0.5}


def _camera(path: str | Path, fields: list[str], line: int) -> _core.Camera:
    model = fields[1]
    if model not in MODELS:
        raise FileError(path, f"model is {model}; only {', '.join(MODELS)} are known", line)
    parameters, lens_model = MODELS[model]
    names = ("width", "height", *parameters)
    if len(fields) != 2 + len(names):
        message = f"{len(fields) - 4} parameters, but {model} has {' '.join(parameters)}"
        raise FileError(path, message, line)
    values = {
        name: float(parse_numbers(path, name, [cell], [line])[0])
        for name, cell in zip(names, fields[2:], strict=True)
    }
    focal = values.get("f", 0)
    values = {"fx": focal, "fy": focal} | values
    lens = [values.get(name, 0.0) for name in PARAMETERS[lens_model]]
    try:
        bent = polynomial(lens + [0.0] * (12 - len(lens)))
        if lens_model not in ("plumb_bob", "rational"):
            bent = Lens(lens_model, tuple(lens))
    except ValueError as error:
        raise FileError(path, str(error), line) from None
    return make_camera(path, from_corner(values), bent, lambda _: line)


def colmap_line(path: str | Path, camera: _core.Camera) -> str:
    """Return the line of a camera with the id 1, as PINHOLE or OPENCV where one of these is enough.

    Raises
    ------
    FileError
        If no model of COLMAP has the lens; ``path`` is that of the file to be written.
    """
    lens = lens_of(camera)
    parameters = [camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, *lens.parameters]
    if lens.is_ideal:
        model = "PINHOLE"
    elif lens.model == "plumb_bob":
        model = "FULL_OPENCV" if lens.parameters[4] else "OPENCV"
    elif lens.model in _WRITTEN:
        model = _WRITTEN[lens.model]
    else:
        raise FileError(path, f"colmap has no place for the lens model {lens.model}")
    count = len(MODELS[model][0])
    numbers = " ".join(map(repr, (parameters + [0.0] * count)[:count]))
    return f"1 {model} {camera.width} {camera.height} {numbers}"


def write_colmap(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as PINHOLE, OPENCV, or the model of COLMAP that has its lens."""
    header = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n"
    write_text(path, f"{header}{colmap_line(path, camera)}\n")


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
