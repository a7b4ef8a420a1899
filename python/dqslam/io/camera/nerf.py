"""Cameras from the ``transforms.json`` of radiance fields: ``fl_x fl_y cx cy w h``.

Pixels are counted from the corner of the image, as in COLMAP, from which such files are made: half
a pixel is subtracted from the principal point. ``camera_model`` is one of COLMAP's.
"""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.colmap import from_corner
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import read_json_table
from dqslam.io.formats import Format


def read_nerf(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read the camera that the frames of a transforms.json share, or that of one of them."""
    table = read_json_table(path)
    frames = table.values.get("frames")
    if "fl_x" in table.values or not isinstance(frames, list):
        one = choose_camera(path, {"0": table}, camera_id)
        return camera_of_names(one, transform=from_corner)
    shared = {key: value for key, value in table.values.items() if key != "frames"}
    different: list[dict[str, object]] = []
    for frame in frames:
        if not isinstance(frame, dict):
            raise table.error("frames has an entry that is no table", "frames")
        own = {key: value for key, value in frame.items() if key not in _OF_FRAMES}
        if own not in different:
            different.append(own)
    cameras = {str(number): table.part(shared | own) for number, own in enumerate(different)}
    return camera_of_names(choose_camera(path, cameras, camera_id), transform=from_corner)


_OF_FRAMES = (
    *("file_path", "transform_matrix", "depth_file_path", "mask_path", "sharpness"),
    *("colmap_im_id", "time", "timestamp"),
)

NERF = Format(
    "nerf",
    "a .json with fl_x",
    lambda look: look.suffix == ".json" and '"fl_x"' in look.head,
    read_nerf,
)
