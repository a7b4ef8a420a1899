"""A session while it runs, as MCAP or over a websocket: map, path and pose of each step."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam._colors import object_colors
from dqslam._files import FileError
from dqslam.online import OnlineSlam, Step
from dqslam.solids import Solids
from dqslam.view.foxglove import Channels, check_times, foxglove_sdk
from dqslam.view.scene import Scene, SceneBoxes, SceneObject

# Map and path are written when this much has passed since they were last written, seconds.
WORLD_S = 1.0
# Chunks are written when they are full: small ones, so that the file is seldom far behind.
CHUNK_BYTES = 16384
_UP = np.array([0.0, 0.0, 1.0])


class SessionRecorder:
    """Writes each step of a session as it is taken."""

    def __init__(
        self, channels: Channels, title: str, *, wait: Callable[[float], None] | None = None
    ) -> None:
        self._channels, self._title, self._wait = channels, title, wait
        self._last: float | None = None

    def __call__(self, slam: OnlineSlam, step: Step) -> None:
        """Write the pose of the last step, its boxes, and, once a second, map and path.

        Raises
        ------
        ValueError
            If the time of the step is none that MCAP has.
        """
        check_times(np.array([step.timestamp]))
        if self._wait is not None:
            self._wait(step.timestamp)
        pose = _core.world_from_camera(slam.pose_model, slam.camera, slam.pose[None])
        self._channels.log_frame(self._scene(slam, step, pose), 0)
        if self._last is None or step.timestamp - self._last >= WORLD_S:
            path = _core.world_from_camera(slam.pose_model, slam.camera, slam.poses)
            self._channels.log_world(self._scene(slam, step, path), len(path) - 1)
            self._last = step.timestamp

    def finish(self, result: Scene) -> None:
        """Write map and paths of the result, at the time of its last pose."""
        self._channels.log_world(result, len(result.timestamps) - 1)

    def _scene(self, slam: OnlineSlam, step: Step, poses: Floats) -> Scene:
        """Return what is known now, with the last step at the end of poses (n, 7)."""
        objects = slam.objects
        rows = {int(one): row for row, one in enumerate(objects.object_ids)}
        shown = [rows.get(int(one), -1) for one in slam.shown]
        box = np.zeros((0, 4)) if step.boxes is None else np.asarray(step.boxes.box)
        return Scene(
            title=self._title,
            up=_UP,
            camera=slam.camera,
            timestamps=np.full(len(poses), step.timestamp),
            estimate=poses,
            odometry=poses[:0],
            cameras=np.zeros(0, dtype=np.int64),
            pose_spreads=(),
            truth=(),
            objects=_objects(slam),
            solids=Solids.of_ellipsoids(objects.ellipsoids),
            true_objects=(),
            boxes=SceneBoxes(
                pose=np.full(len(box), len(poses) - 1),
                box=box,
                object=np.array(shown, dtype=np.int64),
                class_name=() if step.boxes is None else tuple(step.boxes.class_name),
                state=("fits",) * len(box),
            ),
            overview=(),
        )


def _objects(slam: OnlineSlam) -> tuple[SceneObject, ...]:
    from scipy.spatial.transform import Rotation

    objects = slam.objects
    colors = object_colors(objects.class_names)
    found = []
    for row, shape in enumerate(_core.ellipsoid_shapes(objects.ellipsoids)):
        squares, axes = np.linalg.eigh(shape)
        axes[:, 0] *= np.linalg.det(axes)  # makes it a rotation, not a reflection
        found.append(
            SceneObject(
                id=int(objects.object_ids[row]),
                class_name=objects.class_names[row],
                color=colors[row],
                center=objects.centers[row],
                semi_axes=np.sqrt(squares),
                orientation_xyzw=Rotation.from_matrix(axes).as_quat(),
                center_covariance=None,
                numbers=(),
            )
        )
    return tuple(found)


@contextlib.contextmanager
def record_session(path: str | Path) -> Iterator[SessionRecorder]:
    """Open an ``.mcap`` file for a session that begins; needs ``dqslam[mcap]``.

    What is in the file is that of ``write_mcap``, but without truth, and with the map and the path
    as they were known at the time. It grows while the session runs, and is whole at the end, also
    of a session that ends with an error.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    foxglove = foxglove_sdk()
    context = foxglove.Context()
    options = foxglove.mcap.MCAPWriteOptions(chunk_size=CHUNK_BYTES)
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        opened = foxglove.open_mcap(
            path, allow_overwrite=True, context=context, writer_options=options
        )
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror or error}") from None
    with opened:
        yield SessionRecorder(Channels(context), Path(path).stem)


@contextlib.contextmanager
def serve_session(
    title: str, host: str, port: int, *, in_real_time: bool = False
) -> Iterator[tuple[str, SessionRecorder]]:
    """Serve a session that begins over a websocket that Foxglove opens; needs ``dqslam[mcap]``.

    Gives the address, and the recorder that each step is given to. In real time, the recorder
    waits until as much time has passed since the first step as between the times of the steps.

    Raises
    ------
    ValueError
        If the port is taken, or the address is none of this machine.
    """
    foxglove = foxglove_sdk()
    context = foxglove.Context()
    try:
        server = foxglove.start_server(name=title, host=host, port=port, context=context)
    except RuntimeError as error:
        raise ValueError(f"{host}:{port} cannot be served: {error}") from None
    recorder = SessionRecorder(Channels(context), title, wait=_RealTime() if in_real_time else None)
    try:
        yield f"ws://{host}:{server.port}", recorder
    finally:
        server.stop()


class _RealTime:
    """Waits until a step is due, by its time and that of the first one.

    It begins again with a step that is not later than the one before, as in a second replay.
    """

    def __init__(self) -> None:
        self._begin = 0.0  # by the clock, where time 0 of the steps would be
        self._last = np.inf

    def __call__(self, timestamp: float) -> None:
        if timestamp <= self._last:
            self._begin = time.monotonic() - timestamp
        self._last = timestamp
        time.sleep(max(0.0, timestamp - (time.monotonic() - self._begin)))
