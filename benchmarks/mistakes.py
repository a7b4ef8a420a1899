"""How many mistakes in files `dqslam inspect` finds and names: planted in simulated recordings.

    python -m benchmarks.mistakes --seeds 3

Each mistake is made in files that are right. It is *found* if there is a warning, and *named* if
the warning has the option, or the words, that mend it. A cell has the numbers of recordings in
which it is found and named.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import dqslam as dq
from dqslam import _core
from dqslam.inspection import inspect_recording
from dqslam.inspection.tracks import Ids
from dqslam.io import DetectionTable, Trajectory
from dqslam.io.readings import BODY_AXES, OPENGL_AXES
from dqslam.recording import Recording

Floats = NDArray[np.float64]
WORLDS = ("orbit", "orbit_rolls", "paper", "flight", "figure_of_eight")
SE3 = _core.PoseModel.SE3


@dataclass(frozen=True)
class Files:
    """What the files of a recording hold."""

    camera: _core.Camera
    trajectory: Trajectory
    table: DetectionTable

    def with_poses(self, poses: Floats) -> Files:
        """Return the files with other poses at the same times."""
        return replace(self, trajectory=Trajectory(self.trajectory.timestamps, poses))

    def with_boxes(self, box: Floats) -> Files:
        """Return the files with other boxes."""
        return replace(self, table=replace(self.table, box=box))

    def with_times(self, times: Floats) -> Files:
        """Return the files with other times of boxes."""
        return replace(self, table=replace(self.table, timestamp=times))


def files_of(recording: Recording) -> Files:
    """Return what the files of a recording hold: poses of the camera, in space."""
    camera, odometry, boxes = recording.camera, recording.odometry, recording.detections
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    poses = _core.world_from_camera(odometry.pose_model, camera, path)
    names = boxes.class_names
    table = DetectionTable(
        path="boxes.csv",
        columns=("frame", "timestamp", "x1", "y1", "x2", "y2"),
        line=np.arange(len(boxes)) + 2,
        frame=boxes.pose,
        timestamp=recording.timestamps[boxes.pose],
        box=boxes.box,
        score=boxes.score,
        class_id=boxes.class_id,
        class_name=tuple(names[number] for number in boxes.class_id.tolist()),
        track_id=boxes.object_id,
    )
    return Files(camera, Trajectory(recording.timestamps, poses), table)


def turned(poses: Floats, axes: Floats) -> Floats:
    """Return poses (n, 7) of a camera whose axes are these of the true one's."""
    from scipy.spatial.transform import Rotation

    quaternion = (Rotation.from_quat(poses[:, 3:]) * Rotation.from_matrix(axes)).as_quat()
    return np.hstack([poses[:, :3], quaternion])


def noisier(files: Files, factor: float, recording: Recording, seed: int) -> Files:
    """Return the files with odometry that is noisier by a factor."""
    random = np.random.default_rng(seed)
    covariance = np.median(recording.odometry.covariance, axis=0)
    sigma = np.sqrt(factor**2 - 1) * np.repeat(np.sqrt(np.diag(covariance)[[0, -1]]), 3)
    poses = files.trajectory.world_from_camera
    steps = _core.between(SE3, poses[:-1], poses[1:])
    steps = _core.plus(SE3, steps, random.normal(0.0, sigma, (len(steps), 6)))
    return files.with_poses(_core.dead_reckon(SE3, poses[0], steps))


def _poses(change: Callable[[Floats], Floats]) -> Callable[[Files], Files]:
    return lambda files: files.with_poses(change(files.trajectory.world_from_camera))


def _boxes(change: Callable[[Floats, Floats], Floats]) -> Callable[[Files], Files]:
    """Make a mistake in boxes (m, 4), which may depend on the size of the image."""

    def mistaken(files: Files) -> Files:
        size = np.array([files.camera.width, files.camera.height], dtype=float)
        return files.with_boxes(change(files.table.box, size))

    return mistaken


def _images_late(images: float) -> Callable[[Files], Files]:
    def mistaken(files: Files) -> Files:
        times = files.table.timestamp
        interval = float(np.median(np.diff(np.unique(times))))
        return files.with_times(times + images * interval)

    return mistaken


def _drifting(files: Files) -> Files:
    times = files.table.timestamp
    interval = float(np.median(np.diff(np.unique(times))))
    return files.with_times(times + 4 * interval * (times - times[0]) / np.ptp(times))


def _letterboxed(box: Floats, size: Floats) -> Floats:
    return np.asarray(box + np.tile((size.max() - size) / 2, 2))


def _mirrored(poses: Floats) -> Floats:
    """Turn the y axis of the world around, and with it that of the camera."""
    return poses * [1, -1, 1, -1, 1, -1, 1]


def _shuffled(files: Files) -> Files:
    """Give images the boxes of other ones."""
    frames = np.unique(files.table.frame)
    other = np.random.default_rng(0).permutation(frames)
    frame = other[np.searchsorted(frames, files.table.frame)]
    order = np.argsort(frame, kind="stable")
    table = replace(
        files.table,
        frame=frame[order],
        timestamp=files.trajectory.timestamps[frame[order]],
        box=files.table.box[order],
        score=files.table.score[order],
        class_id=files.table.class_id[order],
        track_id=None if files.table.track_id is None else files.table.track_id[order],
    )
    return replace(files, table=table)


def _larger_camera(files: Files) -> Files:
    """Give the camera of an image of twice the size, as binning does."""
    lens = files.camera
    double = _core.Camera(
        2 * lens.fx,
        2 * lens.fy,
        2 * lens.cx + 0.5,
        2 * lens.cy + 0.5,
        2 * lens.width,
        2 * lens.height,
    )
    return replace(files, camera=double)


def _inverse(poses: Floats) -> Floats:
    return np.asarray(_core.inverse(SE3, poses))


#: The mistake, and what a warning has to name.
MISTAKES: dict[str, tuple[Callable[[Files], Files], tuple[str, ...]]] = {
    "camera_from_world": (_poses(_inverse), ("--poses camera_from_world",)),
    "quaternions w first": (_poses(lambda p: p[:, [0, 1, 2, 6, 3, 4, 5]]), ("--poses w_first",)),
    "both": (
        _poses(lambda p: _inverse(p)[:, [0, 1, 2, 6, 3, 4, 5]]),
        ("--poses w_first", "--poses camera_from_world"),
    ),
    "axes of OpenGL": (_poses(lambda p: turned(p, OPENGL_AXES)), ("--poses opengl",)),
    "poses of the body": (_poses(lambda p: turned(p, BODY_AXES.T)), ("--poses body",)),
    "camera on its side": (
        _poses(lambda p: turned(p, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))),
        ("--camera-in-body",),
    ),
    "mirrored world": (_poses(_mirrored), ("mirrored",)),
    "y of positions reversed": (_poses(lambda p: p * [1, -1, 1, 1, 1, 1, 1]), ("x -y z",)),
    "rotations are missing": (
        _poses(lambda p: np.hstack([p[:, :3], np.tile([0.0, 0, 0, 1], (len(p), 1))])),
        ("all rotations are the same",),
    ),
    "millimeters": (
        _poses(lambda p: p * [1000, 1000, 1000, 1, 1, 1, 1]),
        ("--length-scale 0.001",),
    ),
    "x y width height": (
        _boxes(lambda b, _: np.hstack([b[:, :2], b[:, 2:] - b[:, :2]])),
        ("--box-form xywh",),
    ),
    "middle and size": (
        _boxes(lambda b, _: np.hstack([(b[:, :2] + b[:, 2:]) / 2, b[:, 2:] - b[:, :2]])),
        ("--box-form cxcywh",),
    ),
    "y x y x": (_boxes(lambda b, _: b[:, [1, 0, 3, 2]]), ("--box-form yxyx",)),
    "shares of the image": (_boxes(lambda b, s: (b + 0.5) / np.tile(s, 2)), ("--box-image 1x1",)),
    "percent of the image": (
        _boxes(lambda b, s: 100 * (b + 0.5) / np.tile(s, 2)),
        ("--box-image 100x100",),
    ),
    "half the image": (_boxes(lambda b, _: (b + 0.5) / 2 - 0.5), ("--box-image",)),
    "three times the image": (_boxes(lambda b, _: 3 * (b + 0.5) - 0.5), ("--box-image",)),
    "letterbox": (_boxes(_letterboxed), ("--letterbox",)),
    "camera of twice the image": (_larger_camera, ("--box-image",)),
    "milliseconds": (
        lambda files: files.with_times(1e3 * files.table.timestamp),
        ("milliseconds",),
    ),
    "one image late": (_images_late(1), ("--time-offset -",)),
    "two images late": (_images_late(2), ("--time-offset -",)),
    "four images early": (_images_late(-4), ("--time-offset ",)),
    "four images of drift": (_drifting, ("--time-scale",)),
    "images shuffled": (_shuffled, ("no reading of the files",)),
}


def warnings_of(files: Files, ids: Ids | None) -> list[str]:
    """Return what an inspection warns of."""
    inspection = inspect_recording(files.camera, files.trajectory, files.table, ids=ids)
    return [str(finding) for finding in inspection.findings]


def recordings(worlds: tuple[str, ...], seeds: int) -> Iterator[tuple[str, int, Recording]]:
    """Simulate worlds by name."""
    for world in worlds:
        for seed in range(100, 100 + seeds):
            yield world, seed, dq.simulate(dq.load_scenario(world), seed=seed)[0]


def main() -> None:
    """Print the shares of mistakes that are found and named, by world."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--worlds", nargs="*", default=list(WORLDS))
    chosen = parser.parse_args()
    found: dict[tuple[str, str], list[tuple[bool, bool]]] = {}
    for world, _, recording in recordings(tuple(chosen.worlds), chosen.seeds):
        files = files_of(recording)
        for mistake, (make, words) in MISTAKES.items():
            warnings = " ".join(warnings_of(make(files), "track_id"))
            named = all(word in warnings for word in words)
            found.setdefault((mistake, world), []).append((bool(warnings), named))
    print("| mistake | " + " | ".join(chosen.worlds) + " |")  # noqa: T201
    print("|---|" + "---|" * len(chosen.worlds))  # noqa: T201
    for mistake in MISTAKES:
        cells = []
        for world in chosen.worlds:
            counts = np.sum(found[mistake, world], axis=0).tolist()
            cells.append(f"{counts[0]}, {counts[1]}")
        print(f"| {mistake} | " + " | ".join(cells) + " |")  # noqa: T201


if __name__ == "__main__":
    main()
