"""Conversion between formats. Boxes are not cut, and losses of a format are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._input import is_stdin, plain_name
from dqslam.io.camera import CAMERA_FORMATS
from dqslam.io.camera.rosbag import KIND as CAMERA_INFO
from dqslam.io.colmap_model import write_colmap_model
from dqslam.io.detections import DETECTION_FORMATS, DetectionTable
from dqslam.io.detections.embeddings import embeddings_path
from dqslam.io.detections.rosbag import KIND as DETECTION_ARRAY
from dqslam.io.files import FileError, refuse_inputs, whole_folder
from dqslam.io.formats import (
    Format,
    Progress,
    choose_format,
    guarded,
    named_format,
    no_progress,
)
from dqslam.io.frames import BY_NUMBER, write_frame_times
from dqslam.io.notes import Notes
from dqslam.io.pose_graph import pose_graph_of_results, write_g2o
from dqslam.io.reading import ReadOptions, read_boxes_file, read_camera_file, read_path_file
from dqslam.io.results import load_results
from dqslam.io.rosbag import NAME as BAG
from dqslam.io.rosbag import bag_topics
from dqslam.io.sources import KINDS, FormatNames, kind_of
from dqslam.io.trajectory import TRAJECTORY_FORMATS, Trajectory
from dqslam.io.trajectory.rosbag import KINDS as TRAJECTORIES
from dqslam.io.trajectory.tf import STATIC

FORMATS: dict[str, tuple[Format[Any], ...]] = {
    "camera": CAMERA_FORMATS,
    "trajectory": TRAJECTORY_FORMATS,
    "detections": DETECTION_FORMATS,
}
# The files of a converted bag, unless one kind is selected.
FROM_BAG = {
    "camera": ((CAMERA_INFO,), "camera.json", "json"),
    "trajectory": (TRAJECTORIES, "trajectory.txt", "tum"),
    "detections": ((DETECTION_ARRAY,), "boxes.csv", "csv"),
}
STDOUT = Path("/dev/stdout")
FOLDERS = ("yolo", "colmap-model")  #: formats of several files
# What results are written as.
FROM_RESULTS = ("g2o", "gtsam", "colmap-model")


@dataclass(frozen=True)
class Written:
    """A file that was written, its content, and the parts of the source that the format lacks."""

    path: Path
    what: str
    loses: tuple[str, ...] = ()


@dataclass(frozen=True)
class ConvertContext:
    """Information that the files themselves lack; each part is needed by some formats only."""

    reading: ReadOptions = ReadOptions()  #: how the source is read, and the size of the image
    classes: dict[int, str] | None = None
    odometry_covariance: str | Path | None = None  #: covariances of the steps, of results
    notes: Notes = field(default_factory=Notes)  #: collects what is left out and what is doubtful
    files: tuple[Path, ...] = ()  #: the files that these were read from, never written over


def convert(
    source: str | Path,
    out: str | Path,
    *,
    format: str | None = None,
    to: str | None = None,
    context: ConvertContext | None = None,
    progress: Progress = no_progress,
) -> list[Written]:
    """Read a file and write it in another format; the result is complete or absent.

    Parameters
    ----------
    source, out
        Files or folders; ``-`` is standard input and standard output. A bag becomes a folder with
        camera.json, trajectory.txt and boxes.csv, as far as it has these, unless ``to`` names one
        format. A directory of results becomes a pose graph, ``to`` g2o or gtsam, or a folder with
        COLMAP's text model, colmap-model.
    format, to
        Names of formats; by default the format of the source is recognized from the file, and
        that of the target from its ending.
    context
        How the source is read, names of classes, and the accuracy of odometry.
    progress
        Called with the share of a bag or a folder that has been read; not for other files.
    """
    source, out = Path(source), Path(out)
    context = context or ConvertContext()
    if is_stdin(out):
        out = _standard_output(to)
    if (source / "map.json").is_file():
        return _convert_results(source, out, to, context)
    if out.exists() and source.exists() and out.samefile(source):
        raise ValueError(f"{out}: the file would be written over itself")
    for file in (out, _frames_file(out), *([] if out == STDOUT else [embeddings_path(out)])):
        refuse_inputs(file, [*_files_of(source), *context.files])
    kind = _kind(source, format, to)
    if kind is not None:
        target = _target(out, to, kind)
        _check_topics(source, context.reading.topics)
        return _convert(source, out, kind, format, target, context, progress)
    _check_topics(source, context.reading.topics)
    # Transforms that do not move are no trajectory.
    there = {kind for name, kind in bag_topics(source).items() if not name.endswith(STATIC)}
    kinds = [kind for kind, (messages, *_) in FROM_BAG.items() if there & set(messages)]
    if not kinds:
        known = ", ".join(message for messages, *_ in FROM_BAG.values() for message in messages)
        raise FileError(source, f"has no topic of {known}")
    written: list[Written] = []
    with whole_folder(out) as folder:
        for done, kind in enumerate(kinds):
            _, name, target_name = FROM_BAG[kind]
            target = choose_format(out, target_name, FORMATS[kind], kind)
            share = partial(_part_progress, progress, done, len(kinds))
            more = _convert(source, folder / name, kind, BAG, target, context, share)
            written += [Written(out / one.path.name, one.what, one.loses) for one in more]
            share(1.0)
    return written


def _convert_results(
    source: Path, out: Path, to: str | None, context: ConvertContext
) -> list[Written]:
    """Write results for another program."""
    if to is None and out.suffix.lower() == ".g2o":
        to = "g2o"
    refuse_inputs(out, [*_files_of(source), context.odometry_covariance, *context.files])
    results = load_results(source)
    if to == "colmap-model":
        write_colmap_model(out, results)
        what = f"{len(results.poses)} images and {len(results.objects)} points as {to}"
        return [Written(out, what, ("shapes of objects", "covariances"))]
    if to not in FROM_RESULTS:
        known = ", ".join(FROM_RESULTS)
        raise ValueError(f"{source}: it is of results; name a format with --to: {known}")
    graph = pose_graph_of_results(results, context.odometry_covariance)
    write_g2o(out, graph, program="gtsam" if to == "gtsam" else "g2o")
    what = f"{len(graph.poses)} poses, {len(graph.landmarks)} landmarks"
    what += f" and {len(graph.landmark_edges)} edges to them as {to}"
    return [Written(out, what, ("times", "shapes of objects"))]


def _files_of(source: Path) -> list[Path]:
    """Return a source, and what is in it if it is a folder, or else is read with it."""
    if source.is_dir():
        return [source, *source.iterdir()]
    return [source] if is_stdin(source) else [source, embeddings_path(source)]


def _part_progress(progress: Progress, done: int, parts: int, share: float) -> None:
    """Return a progress of one part that reports the share of all parts."""
    progress((done + share) / parts)


def _kind(source: Path, format_name: str | None, to: str | None) -> str | None:
    """Return the kind of the source, or None for a bag whose kinds are all converted."""
    for name, option in ((to, "--to"), (format_name, "--format")):
        kinds = [kind for kind, known in KINDS.items() if name in known]
        if name is not None and not kinds:
            known = ", ".join(dict.fromkeys(name for names in KINDS.values() for name in names))
            raise ValueError(f"{option}: format {name!r} is none of {known}")
    if to == BAG:
        raise ValueError("bags are read, not written")
    by_target = next((kind for kind, known in KINDS.items() if to in known), None)
    if format_name == BAG:
        return by_target
    if format_name is not None:
        found = next(kind for kind, known in KINDS.items() if format_name in known)
    else:
        kind = kind_of(source)
        if kind is None:
            return by_target
        found = kind
    if to is not None and by_target != found:
        raise ValueError(f"{source}: it is of {found}, which {to} is not")
    return found


def _standard_output(to: str | None) -> Path:
    """Return the path of standard output, to which one file can be written."""
    if to is None:
        raise ValueError("-: standard output has no ending: name a format with --to")
    if to in FOLDERS:
        raise ValueError(f"-: {to} is a folder, which standard output cannot be")
    return STDOUT


def _target(out: Path, to: str | None, kind: str) -> Format[Any]:
    if to is not None:
        target = named_format(to, FORMATS[kind], kind)
        if target.write is None:
            raise ValueError(f"--to: {to} is read, not written")
        return target
    # A packed file without another ending is not taken for a folder.
    ending = Path(plain_name(out)).suffix.lower() or out.suffix.lower()
    for format_ in FORMATS[kind]:
        if ending in format_.endings:
            return format_
    known = ", ".join(format_.name for format_ in FORMATS[kind] if format_.write)
    raise ValueError(f"{out}: its ending is of no format of {kind}; name one with --to: {known}")


def _check_topics(source: Path, topics: Sequence[str]) -> None:
    """Refuse topics that a bag does not have."""
    messages = bag_topics(source) if topics else {}
    known = {message for of_kind, *_ in FROM_BAG.values() for message in of_kind}
    for topic in topics:
        if messages.get(topic) not in known:
            has = ", ".join(messages)
            raise FileError(source, f"no topic {topic} that can be read (it has: {has})")


def _convert(
    source: Path,
    out: Path,
    kind: str,
    format_name: str | None,
    target: Format[Any],
    context: ConvertContext,
    progress: Progress,
) -> list[Written]:
    reading = replace(context.reading, formats=FormatNames(**{kind: format_name}))
    if kind == "camera":
        return _write_camera(out, read_camera_file(source, reading), target)
    origin = choose_format(source, format_name, FORMATS[kind], kind)
    # Numbers of frames are enough if neither side has times.
    timeless = reading.frames is None and not guarded(source, origin.name, origin.has_times, source)
    if timeless and not target.needs_times:
        reading = replace(reading, frames=BY_NUMBER)
    if kind == "trajectory":
        whole = read_path_file(source, reading, context.notes, progress=progress)
        trajectory = reading.span.of_path(whole, source)
        return _write_trajectory(out, trajectory, target, times=not timeless)
    table = read_boxes_file(
        source,
        reading.image_size,
        reading,
        context.notes,
        classes=context.classes,
        cut=False,
        progress=progress,
    )
    table = reading.span.of_boxes(table)
    return _write_detections(out, table, target, context, times=not timeless)


def _write_camera(out: Path, camera: _core.Camera, target: Format[Any]) -> list[Written]:
    assert target.write is not None
    target.write(out, camera)
    return [Written(out, f"camera of {camera.width} x {camera.height} px as {target.name}")]


def _write_trajectory(
    out: Path, trajectory: Trajectory, target: Format[Any], *, times: bool
) -> list[Written]:
    assert target.write is not None
    target.write(out, *trajectory)
    count = len(trajectory.timestamps)
    written = [Written(out, f"{count} poses as {target.name}", target.loses)]
    return written + (_beside(out, target, range(count), trajectory.timestamps) if times else [])


def _write_detections(
    out: Path, table: DetectionTable, target: Format[Any], context: ConvertContext, *, times: bool
) -> list[Written]:
    assert target.write is not None
    options: dict[str, Any] = {} if target.name == "csv" else {"times": times}
    if target.name == "yolo":
        size = context.reading.image_size
        if size is None:
            raise ValueError(f"{out}: yolo's boxes are shares of the image: give it with --camera")
        options |= dict(zip(("width", "height"), size, strict=True))
    target.write(out, table, **options)
    written = [Written(out, f"{len(table)} boxes as {target.name}", _loses(out, table, target))]
    return written + (_beside(out, target, table.frame, table.timestamp) if times else [])


def _loses(out: Path, table: DetectionTable, target: Format[Any]) -> tuple[str, ...]:
    """Return what a format of boxes, or a file without files beside it, has no place for."""
    loses = target.loses
    if table.others is not None and target.name != "csv":
        loses += ("other classes of boxes",)
    if table.embedding is not None and (target.name != "csv" or out == STDOUT):
        loses += ("what boxes look like",)
    return loses


def _beside(out: Path, target: Format[Any], frames: ArrayLike, times: ArrayLike) -> list[Written]:
    """Write the times into a file beside one whose format lacks them."""
    if "times" not in target.loses or out == STDOUT:
        return []
    path = _frames_file(out)
    write_frame_times(path, frames, times)
    return [Written(path, "times of its frames, for --frame-times")]


def _frames_file(out: Path) -> Path:
    """Return the file of the times beside one whose format lacks them."""
    return out.with_name(f"{Path(plain_name(out)).stem}.frames.csv")
