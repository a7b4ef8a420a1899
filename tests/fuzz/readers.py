"""Readers of every format of the registry, and of the other files: one clear error, or good data.

A format that can be written joins by itself: its files are made from the corpus by `convert`. Files
as other programs write them, of every format, are in `corpus/formats`.
"""

import random
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import dqslam as dq
from dqslam import io
from dqslam.io.convert import FORMATS, ConvertContext, convert
from dqslam.io.formats import guarded
from dqslam.io.rosbag import NAME as BAG
from dqslam.simulation.scenario import load_scenario
from fuzz.mutate import mutate_file

CORPUS = Path(__file__).resolve().parents[1] / "corpus"
SEEDS = CORPUS / "formats"
SCENARIO = CORPUS.parents[1] / "data" / "scenarios" / "orbit.toml"
SIZE = (640, 480)
SOURCES = {"camera": "camera.json", "trajectory": "trajectory.txt", "detections": "boxes.csv"}
MEASURED = {
    "positions": (
        io.read_positions,
        "pose,object,x,y,z,sigma\n0,0,0.1,0.2,3.0,0.1\n4,1,-0.5,0.0,4.0,0.2\n",
    ),
    "absolute": (
        io.read_absolute,
        "pose,x,y,z,c11,c12,c13,c22,c23,c33\n0,1,2,3,0.04,0,0,0.04,0,0.09\n",
    ),
    "closures": (
        io.read_closures,
        "from_pose,to_pose,x,y,z,qx,qy,qz,qw,sigma_translation,sigma_rotation\n"
        "0,9,0.1,0.0,-0.2,0.0,0.0,0.0,1.0,0.05,0.01\n",
    ),
}


class Wrong(AssertionError):
    """A reader has let through what it must refuse, or refused it in the wrong way."""


@dataclass(frozen=True)
class Reader:
    """A file or folder that is read, and how."""

    name: str
    path: Path
    read: Callable[[Path], Any]


def read_camera(path: Path, format_: str | None = None) -> None:
    camera = io.read_camera(path, format_)
    numbers = [camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion]
    _require(np.isfinite(numbers).all() and camera.fx > 0 and camera.width > 0, "camera")


def read_trajectory(path: Path, format_: str | None = None) -> None:
    notes = io.Notes()
    found = io.read_trajectory(path, format_, frames=io.frame_rate(10.0), notes=notes)
    _check_notes(notes)
    poses = found.world_from_camera
    _require(np.isfinite(poses).all() and poses.shape == (len(found.timestamps), 7), "poses")
    _require(np.isfinite(found.timestamps).all(), "times")
    _require((np.diff(found.timestamps) > 0.0).all(), "order of times")
    _require(np.allclose(np.linalg.norm(poses[:, 3:], axis=1), 1.0, atol=1e-6), "quaternions")


def read_detections(path: Path, format_: str | None = None) -> None:
    notes, frames = io.Notes(), io.frame_rate(10.0)
    if path.name.startswith("minimal"):  # without numbers of frames
        frames = None
    table = io.read_detections(
        path, format_, width=SIZE[0], height=SIZE[1], frames=frames, notes=notes
    )
    _check_notes(notes)
    box = table.box
    _require(np.isfinite(box).all() and (box[:, :2] < box[:, 2:]).all(), "boxes")
    _require(np.isfinite(table.timestamp).all() and np.isfinite(table.score).all(), "times")
    _require(len(box) == len(table.class_id) == len(table.class_name), "classes")


READ = {"camera": read_camera, "trajectory": read_trajectory, "detections": read_detections}


def read_results(path: Path) -> None:
    found = dq.load_results(path)
    _require(np.isfinite(found.poses).all(), "poses")
    _require(np.isfinite(found.objects.centers).all(), "centers")
    _require(len(found.poses) == len(found.timestamps) == len(found.initial_poses), "lengths")


def _read_measured(read: Callable[..., Any], times: Any, path: Path) -> None:
    """Read measurements as a run does, which must be good for a recording."""
    found = guarded(path, "CSV", read, path, times)
    for name, values in vars(found).items():
        _require(np.isfinite(values).all(), name)


def _check_notes(notes: io.Notes) -> None:
    _require(not any("\n" in sentence for sentence in notes.sentences()), "notes of several lines")


def _require(is_good: bool, what: str) -> None:
    if not is_good:
        raise Wrong(f"{what} that are wrong were read")


def readers(folder: Path) -> Iterator[Reader]:
    """Make a good file of every format in a folder, and yield its reader."""
    source = {kind: CORPUS / name for kind, name in SOURCES.items()}
    context = ConvertContext(reading=io.ReadOptions(image_size=SIZE, frames=io.frame_rate(10.0)))
    for kind, formats in FORMATS.items():
        for format_ in formats:
            if format_.write is None:
                continue
            ending = format_.endings[0] if format_.endings else ""
            path = folder / f"{kind}-{format_.name}{ending}"
            convert(source[kind], path, to=format_.name, context=context)
            yield Reader(f"{kind}/{format_.name}", path, READ[kind])
            named = partial(READ[kind], format_=format_.name)
            yield Reader(f"{kind}/{format_.name}, named", path, named)
    yield from _seeds()
    yield Reader("results", CORPUS / "results", read_results)
    yield Reader("true objects", CORPUS / "objects.csv", io.read_true_objects)
    yield Reader("scenario", SCENARIO, lambda path: load_scenario(str(path)))
    times = np.loadtxt(CORPUS / "trajectory.txt")[:, 0]
    covariances = CORPUS / "odometry_covariance.csv"
    yield Reader(
        "step covariances", covariances, lambda path: io.read_step_covariances(path, times)
    )
    for name, (read, text) in MEASURED.items():
        path = folder / f"{name}.csv"
        path.write_text(text)
        yield Reader(name, path, partial(_read_measured, read, times))
    for path in sorted(CORPUS.glob("found/*/*")):  # what was once read wrongly
        yield Reader(f"found/{path.parent.name}", path, READ[path.parent.name])


def _seeds() -> Iterator[Reader]:
    """Yield a reader of each file that another program could have written."""
    for path in sorted(SEEDS.glob("*/*/*")):
        kind, name = path.parts[-3], path.parts[-2]
        if name == BAG and find_spec("rosbags") is None:
            continue
        yield Reader(f"{kind}/{name}/{path.name}", path, READ[kind])
        named = partial(READ[kind], format_=name)
        yield Reader(f"{kind}/{name}/{path.name}, named", path, named)


def try_reader(reader: Reader, seed: str, folder: Path) -> None:
    """Read a mutated copy.

    Raises
    ------
    Exception
        Whatever is neither good data nor one error that names the file.
    """
    rng = random.Random(seed)
    copied = folder / reader.path.name
    if reader.path.is_dir():
        shutil.copytree(reader.path, copied)
    else:
        shutil.copyfile(reader.path, copied)
    try:
        mutate_file(copied, rng)
        reader.read(copied)
    except ValueError as error:
        if isinstance(error.__cause__, Warning):
            raise Wrong(f"a number was not checked before it was used: {error}") from error
        if str(folder) not in str(error):
            raise Wrong(f"the error does not name the file: {error}") from error
        if "\n" in str(error) and not hasattr(error, "errors"):
            raise Wrong(f"the error has several lines: {error!r}") from error
    finally:
        shutil.rmtree(copied) if copied.is_dir() else copied.unlink(missing_ok=True)
