"""A scene as MCAP with the schemas of Foxglove, as a file or live over a websocket.

Topics: ``/map`` has the surface of each object or its ellipsoid, cuboid or cylinder, ``/truth`` a
cuboid for each true object of known size, ``/paths`` the paths, also of what moves. For each pose,
at its time, ``/tf`` has camera in world, ``/pose`` the same as a pose, ``/tracks`` a cuboid for
each thing that moves, ``/boxes`` the boxes of the image and ``/outlines`` the outlines of the
objects in it, in undistorted pixels. ``/calibration`` is the pinhole of these pixels.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import ESTIMATE, GRAY, ODOMETRY, TRUTH
from dqslam._files import whole_file
from dqslam.view.messages import WORLD, moving_cuboids
from dqslam.view.messages import color as _color
from dqslam.view.messages import pose as _pose
from dqslam.view.messages import quaternion as _quaternion
from dqslam.view.messages import vector as _vector
from dqslam.view.picture import outlines_in_image
from dqslam.view.scene import Scene, SceneObject
from dqslam.view.surface_mesh import SurfaceMesh
from dqslam.view.surfaces import coarser

if TYPE_CHECKING:
    from foxglove import Context

CAMERA = "camera"
#: What a protobuf's time can be, seconds since 1970.
_LATEST_S = 2.0**32 - 1.0
_CORNER = 0.5  # Foxglove counts pixels from the corner of the image
_LABEL_M = 0.05
_MOST_TRIANGLES = 5_000  # of a surface, which is repeated every second when it is live


def write_mcap(
    scene: Scene, path: str | Path, progress: Callable[[float], None] = lambda share: None
) -> None:
    """Write an ``.mcap`` file; needs ``dqslam[mcap]``. `progress` gets the share of the images.

    Raises
    ------
    ValueError
        If a time is before 1970 or after 2106, which the schemas have no place for.
    """
    foxglove = foxglove_sdk()
    check_times(scene.timestamps)
    with whole_file(path) as temporary:
        context = foxglove.Context()
        with foxglove.open_mcap(temporary, allow_overwrite=True, context=context):
            channels = Channels(context)
            channels.log_world(scene)
            for frame in range(len(scene.timestamps)):
                channels.log_frame(scene, frame)
                progress((frame + 1) / len(scene.timestamps))


@contextlib.contextmanager
def serve_foxglove(scene: Scene, host: str, port: int) -> Iterator[tuple[str, Callable[[], None]]]:
    """Serve a scene over a websocket that Foxglove opens.

    Gives the address, and a function that plays the recording once in real time; the map is
    repeated every second, for those who join.
    """
    foxglove = foxglove_sdk()
    check_times(scene.timestamps)
    context = foxglove.Context()
    server = foxglove.start_server(name=scene.title, host=host, port=port, context=context)
    channels = Channels(context)

    def play() -> None:
        shown, start = -np.inf, time.monotonic()
        for frame, at in enumerate(scene.timestamps - scene.timestamps[0]):
            time.sleep(max(0.0, float(at) - (time.monotonic() - start)))
            if time.monotonic() - shown >= 1.0:
                channels.log_world(scene, frame)
                shown = time.monotonic()
            channels.log_frame(scene, frame)

    try:
        yield f"ws://{host}:{server.port}", play
    finally:
        server.stop()


def foxglove_sdk() -> Any:
    """Return the package of Foxglove, or raise a RuntimeError that names the extra."""
    try:
        import foxglove
    except ModuleNotFoundError:
        raise RuntimeError("MCAP needs foxglove-sdk: pip install 'dqslam[mcap]'") from None
    return foxglove


def check_times(timestamps: Floats) -> None:
    """Refuse times (n,) [s] that MCAP has no place for."""
    bad = np.flatnonzero((timestamps < 0.0) | (timestamps > _LATEST_S))
    if bad.size:
        at = timestamps[bad[0]]
        raise ValueError(
            f"pose {bad[0]} is at {at:g} s: MCAP has times from 0 to {_LATEST_S:.0f} s"
        )


class Channels:
    """The topics of one sink, and what is logged to them."""

    def __init__(self, context: Context) -> None:
        from foxglove import channels

        self.map = channels.SceneUpdateChannel("/map", context=context)
        self.truth = channels.SceneUpdateChannel("/truth", context=context)
        self.paths = channels.SceneUpdateChannel("/paths", context=context)
        self.tf = channels.FrameTransformsChannel("/tf", context=context)
        self.pose = channels.PoseInFrameChannel("/pose", context=context)
        self.boxes = channels.ImageAnnotationsChannel("/boxes", context=context)
        self.outlines = channels.ImageAnnotationsChannel("/outlines", context=context)
        self.calibration = channels.CameraCalibrationChannel("/calibration", context=context)
        self.tracks = channels.SceneUpdateChannel("/tracks", context=context)

    def log_world(self, scene: Scene, frame: int = 0) -> None:
        """Log what does not move, at the time of a pose."""
        from foxglove.messages import SceneUpdate

        at, stamp = _times(scene, frame)
        objects = [_object(row, one, stamp) for row, one in enumerate(scene.objects)]
        self.map.log(SceneUpdate(entities=objects), log_time=at)
        cuboids = [
            _cuboid(row, one, stamp)
            for row, one in enumerate(scene.true_objects)
            if one.semi_axes is not None
        ]
        if cuboids:
            self.truth.log(SceneUpdate(entities=cuboids), log_time=at)
        runs = [("estimate", [scene.estimate], ESTIMATE), ("odometry", [scene.odometry], ODOMETRY)]
        runs.append(("truth", list(scene.truth), TRUTH))
        for one in scene.tracks:
            runs.append((f"track {one.track.track_id}", [one.track.centers], one.color))
        paths = [_path(*run, stamp) for run in runs if run[1]]
        self.paths.log(SceneUpdate(entities=paths), log_time=at)
        self.calibration.log(_calibration(scene, stamp), log_time=at)

    def log_frame(self, scene: Scene, frame: int) -> None:
        """Log the camera of a pose, what moves, the boxes of its image, and the outlines in it."""
        from foxglove.messages import FrameTransform, FrameTransforms, ImageAnnotations, PoseInFrame

        at, stamp = _times(scene, frame)
        here = scene.estimate[frame]
        transform = FrameTransform(
            timestamp=stamp,
            parent_frame_id=WORLD,
            child_frame_id=CAMERA,
            translation=_vector(here[:3]),
            rotation=_quaternion(here[3:]),
        )
        self.tf.log(FrameTransforms(transforms=[transform]), log_time=at)
        pose = PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=_pose(here[:3], here[3:]))
        self.pose.log(pose, log_time=at)
        if scene.tracks:
            self.tracks.log(moving_cuboids(scene.tracks, frame, stamp), log_time=at)
        boxes = scene.boxes
        drawn = []
        for row in np.flatnonzero(boxes.pose == frame).tolist():
            u_min, v_min, u_max, v_max = boxes.box[row]
            corners = np.array([[u_min, v_min], [u_max, v_min], [u_max, v_max], [u_min, v_max]])
            seen = int(boxes.object[row])
            color = GRAY if seen < 0 else scene.objects[seen].color
            drawn.append(_loop(corners, color, stamp))
        self.boxes.log(ImageAnnotations(points=drawn), log_time=at)
        rows, outlines = outlines_in_image(scene, frame)
        loops = [
            _loop(outline, scene.objects[row].color, stamp)
            for row, outline in zip(rows, outlines, strict=True)
        ]
        self.outlines.log(ImageAnnotations(points=loops), log_time=at)


def _times(scene: Scene, frame: int) -> tuple[int, Any]:
    """Return the time of a pose in nanoseconds, and as a timestamp."""
    from foxglove.messages import Timestamp

    at = round(float(scene.timestamps[frame]) * 1e9)
    return at, Timestamp(at // 10**9, at % 10**9)


def _object(row: int, one: SceneObject, stamp: Any) -> Any:
    """Return an object in its shape, of three full lengths, with its name."""
    from foxglove.messages import (
        Color,
        CubePrimitive,
        CylinderPrimitive,
        SceneEntity,
        SpherePrimitive,
        TextPrimitive,
    )

    spheres, cubes, cylinders, triangles = [], [], [], []
    if one.surface is not None:
        triangles.append(_triangles(one, one.surface))
    elif one.body is not None:
        placed: dict[str, Any] = {
            "pose": _pose(one.center, one.body.orientation_xyzw),
            "size": _vector(2.0 * one.body.half_lengths),
            "color": _color(one.color, 0.7),
        }
        if one.body.shape == "cuboid":
            cubes.append(CubePrimitive(**placed))
        else:  # along its z, between two circles that are scaled as one is
            cylinders.append(CylinderPrimitive(**placed, bottom_scale=1.0, top_scale=1.0))
    elif one.semi_axes is not None and one.orientation_xyzw is not None:
        spheres.append(
            SpherePrimitive(
                pose=_pose(one.center, one.orientation_xyzw),
                size=_vector(2.0 * one.semi_axes),
                color=_color(one.color, 0.7),
            )
        )
    name = f"{one.class_name} {one.id}"
    text = TextPrimitive(
        pose=_pose(one.center, np.array([0.0, 0.0, 0.0, 1.0])),
        billboard=True,
        font_size=_LABEL_M,
        color=Color(r=1.0, g=1.0, b=1.0, a=1.0),
        text=name,
    )
    return SceneEntity(
        timestamp=stamp,
        frame_id=WORLD,
        id=f"object {row}",
        spheres=spheres,
        cubes=cubes,
        cylinders=cylinders,
        triangles=triangles,
        texts=[text],
        metadata=_metadata(one),
    )


def _triangles(one: SceneObject, surface: SurfaceMesh) -> Any:
    """Return the surface of an object, which is in the frame of its ellipsoid."""
    from foxglove.messages import Color, Point3, TriangleListPrimitive

    assert one.orientation_xyzw is not None  # of each object with a surface
    drawn = coarser(surface, _MOST_TRIANGLES)
    return TriangleListPrimitive(
        pose=_pose(one.center, one.orientation_xyzw),
        points=[Point3(x=x, y=y, z=z) for x, y, z in drawn.vertices.tolist()],
        colors=[Color(r=r, g=g, b=b, a=1.0) for r, g, b in (drawn.colors / 255).tolist()],
        indices=drawn.triangles.ravel().tolist(),
    )


def _cuboid(row: int, one: SceneObject, stamp: Any) -> Any:
    from foxglove.messages import CubePrimitive, SceneEntity

    assert one.semi_axes is not None and one.orientation_xyzw is not None
    cube = CubePrimitive(
        pose=_pose(one.center, one.orientation_xyzw),
        size=_vector(2.0 * one.semi_axes),
        color=_color(TRUTH, 0.35),
    )
    return SceneEntity(
        timestamp=stamp,
        frame_id=WORLD,
        id=f"true object {row}",
        cubes=[cube],
        metadata=_metadata(one),
    )


def _metadata(one: SceneObject) -> list[Any]:
    from foxglove.messages import KeyValuePair

    described = (("id", str(one.id)), ("class", one.class_name), *one.numbers)
    return [KeyValuePair(key=name, value=value) for name, value in described]


def _path(name: str, runs: list[Floats], color: str, stamp: Any) -> Any:
    from foxglove.messages import LinePrimitive, LinePrimitiveLineType, Point3, SceneEntity

    lines = [
        LinePrimitive(
            type=LinePrimitiveLineType.LineStrip,
            thickness=2.0,
            scale_invariant=True,
            points=[Point3(x=x, y=y, z=z) for x, y, z in run[:, :3].tolist()],
            color=_color(color, 1.0),
        )
        for run in runs
    ]
    return SceneEntity(timestamp=stamp, frame_id=WORLD, id=name, lines=lines)


def _calibration(scene: Scene, stamp: Any) -> Any:
    from foxglove.messages import CameraCalibration

    camera = scene.camera
    cx, cy = camera.cx, camera.cy
    return CameraCalibration(
        timestamp=stamp,
        frame_id=CAMERA,
        width=camera.width,
        height=camera.height,
        K=[camera.fx, 0.0, cx, 0.0, camera.fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[camera.fx, 0.0, cx, 0.0, 0.0, camera.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def _loop(points: Floats, color: str, stamp: Any) -> Any:
    """Return a closed line in an image through points (n, 2) px."""
    from foxglove.messages import Point2, PointsAnnotation, PointsAnnotationType

    return PointsAnnotation(
        timestamp=stamp,
        type=PointsAnnotationType.LineLoop,
        points=[Point2(x=u + _CORNER, y=v + _CORNER) for u, v in points.tolist()],
        outline_color=_color(color, 1.0),
        thickness=1.5,
    )
