"""A scene as a recording for the Rerun viewer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import ESTIMATE, ODOMETRY, TRUTH
from dqslam._files import whole_file
from dqslam.view.picture import outlines_in_image
from dqslam.view.scene import Scene, SceneObject, Spread, rgb

if TYPE_CHECKING:
    from rerun import RecordingStream


def write_rerun(
    scene: Scene, path: str | Path, progress: Callable[[float], None] = lambda share: None
) -> None:
    """Write an ``.rrd`` file; needs ``dqslam[rerun]``. `progress` gets the share of the images.

    ``world/`` has the static entities ``estimate``, ``odometry``, ``truth``, ``objects``,
    ``true_objects`` and ``covariance``. On the timelines ``time`` [s] and ``image`` it has the
    ``camera``, and in its image ``boxes`` and ``outlines``.
    """
    try:
        import rerun
    except ModuleNotFoundError:
        raise RuntimeError("--rerun needs rerun-sdk: pip install 'dqslam[rerun]'") from None
    with whole_file(path) as temporary:
        stream = rerun.RecordingStream("dqslam")
        stream.save(temporary)
        stream.send_recording_name(scene.title)
        _log_world(stream, scene)
        for frame in range(len(scene.timestamps)):
            _log_frame(stream, scene, frame)
            progress((frame + 1) / len(scene.timestamps))
        stream.disconnect()  # writes the rest


def _log_world(stream: RecordingStream, scene: Scene) -> None:
    import rerun

    _log_up(stream, scene.up)
    paths = (
        ("estimate", (scene.estimate,), ESTIMATE),
        ("odometry", (scene.odometry,), ODOMETRY),
        ("truth", scene.truth, TRUTH),
    )
    for name, runs, color in paths:
        if runs:
            strips = rerun.LineStrips3D([run[:, :3] for run in runs], colors=[rgb(color)])
            stream.log(f"world/{name}", strips, static=True)
    _log_objects(stream, "objects", list(scene.objects), [one.color for one in scene.objects])
    true = list(scene.true_objects)
    _log_objects(stream, "true_objects", true, [TRUTH for _ in true], labels=False)
    spreads = [one.spread for one in scene.objects if one.spread is not None]
    _log_spreads(stream, "covariance/objects", spreads)
    _log_spreads(stream, "covariance/poses", list(scene.pose_spreads))
    camera = scene.camera
    pinhole = rerun.Pinhole(
        focal_length=[camera.fx, camera.fy],
        # Rerun counts from the corner of the image.
        principal_point=[camera.cx + 0.5, camera.cy + 0.5],
        resolution=[camera.width, camera.height],
        camera_xyz=rerun.ViewCoordinates.RDF,
    )
    stream.log("world/camera", pinhole, static=True)


def _log_up(stream: RecordingStream, up: Floats) -> None:
    """Log the axis of the world that is up, if there is one."""
    import rerun

    axis = int(np.argmax(np.abs(up)))
    if abs(up[axis]) > 1.0 - 1e-9:
        direction = "UP" if up[axis] > 0.0 else "DOWN"
        name = f"RIGHT_HAND_{'XYZ'[axis]}_{direction}"
        stream.log("world", getattr(rerun.ViewCoordinates, name), static=True)


def _log_objects(
    stream: RecordingStream,
    name: str,
    objects: list[SceneObject],
    colors: list[str],
    *,
    labels: bool = True,
) -> None:
    """Log objects in their shapes, and those without one as points."""
    import rerun

    named = [f"{one.class_name} {one.id}" for one in objects]
    plain = [k for k, one in enumerate(objects) if one.body is None and one.semi_axes is not None]
    points = [k for k, one in enumerate(objects) if one.semi_axes is None]
    if plain:
        shown: dict[str, Any] = {
            "centers": [objects[k].center for k in plain],
            "half_sizes": [objects[k].semi_axes for k in plain],
            "quaternions": [objects[k].orientation_xyzw for k in plain],
            "colors": [rgb(colors[k]) for k in plain],
        }
        if labels:
            shown["labels"] = [named[k] for k in plain]
        stream.log(f"world/{name}", rerun.Ellipsoids3D(**shown), static=True)
    for kind in ("cuboid", "cylinder"):
        rows = [k for k, one in enumerate(objects) if one.body and one.body.shape == kind]
        if not rows:
            continue
        bodies = [one.body for one in objects if one.body and one.body.shape == kind]
        given: dict[str, Any] = {
            "centers": [objects[k].center for k in rows],
            "quaternions": [body.orientation_xyzw for body in bodies],
            "colors": [rgb(colors[k]) for k in rows],
        }
        if labels:
            given["labels"] = [named[k] for k in rows]
        sizes = [body.half_lengths for body in bodies]
        entity = f"world/{name}/{kind}s"
        if kind == "cuboid":
            stream.log(entity, rerun.Boxes3D(half_sizes=sizes, **given), static=True)
        else:  # round, as rerun has no others
            radii = [float(np.sqrt(size[0] * size[1])) for size in sizes]
            lengths = [2.0 * float(size[2]) for size in sizes]
            drawn = rerun.Cylinders3D(lengths=lengths, radii=radii, **given)
            stream.log(entity, drawn, static=True)
    if points:
        centers = [objects[k].center for k in points]
        dots = rerun.Points3D(centers, colors=[rgb(colors[k]) for k in points])
        stream.log(f"world/{name}/points", dots, static=True)


def _log_spreads(stream: RecordingStream, name: str, spreads: list[Spread]) -> None:
    import rerun

    if spreads:
        ellipsoids = rerun.Ellipsoids3D(
            centers=[one.center for one in spreads],
            half_sizes=[one.semi_axes for one in spreads],
            quaternions=[one.orientation_xyzw for one in spreads],
            colors=[(17, 17, 17)],
        )
        stream.log(f"world/{name}", ellipsoids, static=True)


def _log_frame(stream: RecordingStream, scene: Scene, frame: int) -> None:
    import rerun

    stream.set_time("time", duration=float(scene.timestamps[frame]))
    stream.set_time("image", sequence=frame)
    pose = scene.estimate[frame]
    stream.log("world/camera", rerun.Transform3D(translation=pose[:3], quaternion=pose[3:]))
    boxes = scene.boxes
    shown = np.flatnonzero(boxes.pose == frame)
    colors = [_box_color(scene, int(row)) for row in shown]
    labels = [boxes.class_name[row] for row in shown]
    drawn = rerun.Boxes2D(
        array=_from_corner(boxes.box[shown]),
        array_format=rerun.Box2DFormat.XYXY,
        colors=colors,
        labels=labels,
    )
    stream.log("world/camera/boxes", drawn)
    rows, outlines = outlines_in_image(scene, frame)
    strips = rerun.LineStrips2D(
        list(_from_corner(outlines)), colors=[rgb(scene.objects[row].color) for row in rows]
    )
    stream.log("world/camera/outlines", strips)


def _box_color(scene: Scene, row: int) -> tuple[int, int, int]:
    of = int(scene.boxes.object[row])
    return (150, 150, 150) if of < 0 else rgb(scene.objects[of].color)


def _from_corner(pixels: Floats) -> Floats:
    """Return pixels counted from the corner of the image, as in Rerun, instead of from a center."""
    return pixels + 0.5
