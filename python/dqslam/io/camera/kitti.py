"""Cameras from KITTI's calibration: the 3 x 4 projection of a rectified camera, by default 2.

The left color camera is ``P2:`` in the files of the odometry, tracking and object benchmarks, and
``P_rect_02:`` in the raw ``calib_cam_to_cam.txt``. There is no distortion, and integer pixel
coordinates are centers of pixels. Only the raw file has the image size, ``S_rect_02:``; the others
need such a line added, for instance ``S_rect_02: 1242 375``, or the size beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import make_camera
from dqslam.io.camera.lenses import IDEAL
from dqslam.io.files import FileError, parse_numbers, read_rows, write_text
from dqslam.io.formats import Format, Look

LEFT_COLOR = "2"
STARTS = ("P0:", "P2:", "P_rect_02:", "calib_time:")


def read_kitti_calib(
    path: str | Path, *, camera_id: str | None = None, image_size: tuple[int, int] | None = None
) -> _core.Camera:
    """Read camera 2 of a KITTI calibration, or another: 0, 1, 2, 3.

    ``image_size`` px is used if the file has none.
    """
    rows, lines = read_rows(path)
    entries = [row.partition(":") for row in rows]
    line_of = {key.strip(): line for (key, _, _), line in zip(entries, lines, strict=True)}
    cells = {key.strip(): value.split() for key, _, value in entries}
    one = LEFT_COLOR if camera_id is None else camera_id
    names, size_name = (f"P{one}", f"P_rect_0{one}"), f"S_rect_0{one}"
    name = next((name for name in names if name in cells), None)
    if name is None:
        raise FileError(path, f"no line {' or '.join(names)} (it has: {', '.join(cells)})")
    if size_name not in cells and image_size is None:
        message = f'no image size: add a line "{size_name}: WIDTH HEIGHT", or say --image-size'
        raise FileError(path, message)
    projection = _numbers(path, name, cells[name], 12, line_of[name])
    size: Sequence[float] = image_size or ()
    if size_name in cells:
        size = _numbers(path, size_name, cells[size_name], 2, line_of[size_name])
    fx, skew, cx, _, zero, fy, cy, _, *last = projection
    if (skew, zero, *last[:3]) != (0, 0, 0, 0, 1):
        raise FileError(path, f"{name} is no projection of a rectified camera", line_of[name])
    values = dict(
        zip(("fx", "fy", "cx", "cy", "width", "height"), (fx, fy, cx, cy, *size), strict=True)
    )
    return make_camera(
        path,
        values,
        IDEAL,
        lambda key: line_of.get(size_name if key in ("width", "height") else name),
    )


def write_kitti_calib(path: str | Path, camera: _core.Camera) -> None:
    """Write P2 and S_rect_02 of a camera without distortion."""
    if camera.has_distortion:
        raise FileError(path, "kitti-calib has no place for lens distortion")
    row = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    numbers = " ".join(map(repr, row))
    write_text(path, f"P2: {numbers}\nS_rect_02: {camera.width} {camera.height}\n")


def _numbers(path: str | Path, name: str, cells: list[str], count: int, line: int) -> list[float]:
    if len(cells) != count:
        raise FileError(path, f"{name} has {len(cells)} numbers, not {count}", line)
    values: list[float] = parse_numbers(path, name, cells, [line] * count).tolist()
    return values


def _looks(look: Look) -> bool:
    return look.first.startswith(STARTS)


KITTI_CALIB = Format(
    "kitti-calib",
    f"its first line starts with one of {' '.join(STARTS)}",
    _looks,
    read_kitti_calib,
    write_kitti_calib,
)
