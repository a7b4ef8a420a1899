"""A scene as a folder with a page that works on any web server, and in a browser without one.

The page has a few hundred lines of our own and no library. viser's static export has the scene but
no slider and no clicks, and a 3D library would be a hundred times as large as the part that is
needed. Nothing is fetched from elsewhere.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import ESTIMATE, ODOMETRY, TRUTH
from dqslam._outputs import output_set
from dqslam.io.files import write_text
from dqslam.view.body import Body
from dqslam.view.scene import Scene, SceneObject, Spread
from dqslam.view.surface_mesh import SurfaceMesh
from dqslam.view.surfaces import coarser
from dqslam.view.tracks import SceneTrack

_STATIC = Path(__file__).with_name("static")
WRITTEN_BY = "dqslam view"
# Micrometers and microradians are enough; more digits would only make the file larger.
_DECIMALS = 6
_SURFACE_DECIMALS = 4
# Triangles of all surfaces together, and of one, which a browser without a graphics card turns
# without a delay that is felt.
_MOST_TRIANGLES, _MOST_OF_ONE, _LEAST_OF_ONE = 8_000, 2_000, 100


def write_page(scene: Scene, directory: str | Path) -> Path:
    """Write the page into a folder, created if needed, and return its ``index.html``.

    Raises
    ------
    FileError
        If the folder has files that are not of an earlier page.
    """
    directory = Path(directory)
    with output_set(directory, WRITTEN_BY) as folder:
        write_page_files(scene, folder)
    return directory / "index.html"


def write_page_files(
    scene: Scene, folder: Path, *, images: Sequence[str | None] | None = None
) -> None:
    """Write the page into a folder that has none.

    ``images`` has the name of the photograph of each pose, in the folder of ``photographs``.
    """
    for source in sorted(_STATIC.iterdir()):
        shutil.copyfile(source, folder / source.name)
    # A script, not JSON, because a browser that opens the folder itself may not fetch files.
    text = json.dumps(_describe(scene) | {"images": images}, separators=(",", ":"), allow_nan=False)
    write_text(folder / "scene.js", f"const scene = {text};\n")


def _describe(scene: Scene) -> dict[str, Any]:
    boxes = scene.boxes
    names = ("fx", "fy", "cx", "cy", "width", "height")
    surfaces = sum(one.surface is not None for one in scene.objects)
    most = int(np.clip(_MOST_TRIANGLES // max(surfaces, 1), _LEAST_OF_ONE, _MOST_OF_ONE))
    return {
        "title": scene.title,
        "up": _rounded(scene.up),
        "colors": {"estimate": ESTIMATE, "odometry": ODOMETRY, "truth": TRUTH},
        "camera": {name: getattr(scene.camera, name) for name in names},
        "timestamps": scene.timestamps.tolist(),
        "estimate": _rounded(scene.estimate),
        "odometry": _rounded(scene.odometry),
        "cameras": scene.cameras.tolist(),
        "poseSpreads": [_spread(one) for one in scene.pose_spreads],
        "truth": [_rounded(run) for run in scene.truth],
        "objects": [
            _object(one) | {"surface": None if one.surface is None else _surface(one.surface, most)}
            for one in scene.objects
        ],
        "trueObjects": [_object(one) for one in scene.true_objects],
        "tracks": [_track(one) for one in scene.tracks],
        "boxes": {
            "pose": boxes.pose.tolist(),
            "box": np.round(boxes.box, 2).tolist(),
            "object": boxes.object.tolist(),
            "className": list(boxes.class_name),
            "state": list(boxes.state),
        },
        "overview": scene.overview,
    }


def _object(one: SceneObject) -> dict[str, Any]:
    spread = one.spread
    return {
        "id": one.id,
        "className": one.class_name,
        "color": one.color,
        "center": _rounded(one.center),
        "semiAxes": None if one.semi_axes is None else _rounded(one.semi_axes),
        "orientation": None if one.orientation_xyzw is None else _rounded(one.orientation_xyzw),
        "body": None if one.body is None else _body(one.body),
        "spread": None if spread is None else _spread(spread),
        "numbers": one.numbers,
        "chiSquare": None if one.chi_square is None else round(one.chi_square, 3),
    }


def _track(one: SceneTrack) -> dict[str, Any]:
    track = one.track
    return {
        "id": track.track_id,
        "className": track.class_name,
        "color": one.color,
        "sides": _rounded(track.sides),
        "pose": track.pose.tolist(),
        "centers": _rounded(track.centers),
        "orientations": _rounded(track.orientations),
        "names": [one.name_at(row) for row in range(len(track))],
    }


def _body(one: Body) -> dict[str, Any]:
    return {
        "shape": one.shape,
        "hull": _rounded(one.hull),
        "lines": [_rounded(line) for line in one.lines],
    }


def _surface(one: SurfaceMesh, most: int) -> dict[str, Any]:
    drawn = coarser(one, most)
    return {
        "vertices": np.round(drawn.vertices, _SURFACE_DECIMALS).tolist(),
        "triangles": drawn.triangles.tolist(),
        "colors": drawn.colors.tobytes().hex(),  # six digits for each vertex
    }


def _spread(one: Spread) -> dict[str, Any]:
    return {
        "center": _rounded(one.center),
        "semiAxes": one.semi_axes.tolist(),  # not rounded, as they may be far below a micrometer
        "orientation": _rounded(one.orientation_xyzw),
    }


def _rounded(values: Floats) -> Any:
    return np.round(values, _DECIMALS).tolist()
