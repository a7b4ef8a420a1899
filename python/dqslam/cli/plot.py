"""``dqslam plot``: figures of results or of a sweep, and outlines over images."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dqslam._files import FileError, refuse_inputs
from dqslam._manifest import check_files
from dqslam._outputs import belongs_to, output_set
from dqslam.cli.found import read_with_truth
from dqslam.cli.options import (
    Alignment,
    FrameRate,
    FrameTimesFile,
    TrueObjectsFile,
    TruthFile,
    given_frame_times,
)
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile, save_settings

if TYPE_CHECKING:
    from dqslam.io import Results

CHANGES_FILE = "changes.json"
_STILLS = 9  # number of images, evenly spread, if no frames are given


def plot(
    context: typer.Context,
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="Directory that `dqslam run`, `simulate`, `sweep` or `changes` wrote.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FOLDER", help="Directory of the figures. Default: DIR/figures."
        ),
    ] = None,
    kind: Annotated[
        Literal["svg", "png", "pdf"], typer.Option("--kind", help="File format of the figures.")
    ] = "svg",
    groundtruth: TruthFile = None,
    objects: TrueObjectsFile = None,
    align: Alignment = "se3",
    images: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Also draw the outlines of the objects over these images. Their times come from "
            "--frame-times, from their names, or from their order.",
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="POSES",
            help="Images of these poses, counted from 0: 0,17,100-200, or 0-1000:10 for every "
            f"tenth. Default: {_STILLS} that are evenly spread, or all for a film.",
        ),
    ] = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    video: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Make a film of the images instead: .mp4 (needs ffmpeg) or .gif."
        ),
    ] = None,
    video_rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            min=0.1,
            max=120.0,
            help="Frames per second of the film. Default: real time if possible, else 10.",
        ),
    ] = None,
    parameter: Annotated[
        str | None,
        typer.Option(help="For a sweep: the setting of the axis. Default: the first varied one."),
    ] = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Draw the results in DIR: the map from above, errors over time, residuals, boxes.

    For a sweep, it draws the errors against the varied settings, for changes the map from above
    with what became of each object. It needs the extra "plot".
    docs/plots.md describes each figure. Options are written to plot.toml beside the figures.
    """
    from dqslam import io
    from dqslam.plot import plot_results

    if find_spec("matplotlib") is None:
        raise ValueError("figures need matplotlib: pip install 'dqslam[plot]'")
    if images is None and (video is not None or frames is not None):
        raise ValueError("--frames and --video need --images")
    if video is not None:
        from dqslam.plot.overlay import check_video

        check_video(video)
    if not directory.is_dir():
        raise FileError(directory, "no such directory")
    output = Output(quiet=quiet, as_json=json)
    out = directory / "figures" if out is None else out
    inputs = (directory, groundtruth, objects, images, frame_times)
    if video is not None:
        refuse_inputs(video, [*inputs, *_files_of(images)])
    left_out: dict[str, str] = {}
    with output_set(out, "dqslam plot", inputs=inputs) as folder:
        if _is_sweep(directory):
            files = [_plot_sweep(directory, folder, kind, parameter, output)]
        elif _is_changes(directory):
            files = [_plot_changes(directory, folder / f"changes.{kind}", output)]
        else:
            if parameter is not None:
                raise ValueError(f"--parameter needs a sweep, which {directory} is not")
            results, truth, true_objects = read_with_truth(directory, groundtruth, objects)
            shown: dict[int, Path] = {}
            if images is not None:
                times = given_frame_times(frame_times, frame_rate)
                found = io.find_images(images, results.timestamps, times)
                shown = _choose(frames, found, is_film=video is not None)
            with output.share("drawing") as progress:
                drawn = plot_results(
                    results,
                    folder,
                    kind=kind,
                    groundtruth=truth,
                    objects=true_objects,
                    align=align,
                    progress=progress,
                )
            files, left_out = list(drawn.written), drawn.left_out
            if images is not None:
                film = None if video is None else _moved(video, out, folder)
                files += _overlay(results, shown, folder, film, video_rate, output)
        save_settings(context, folder / "plot.toml")
    belongs_to(directory, out)
    files = [_moved(file, folder, out) for file in files]
    for name, why in left_out.items():
        output.line(f"no {name}: {why}")
    for file in files:
        output.line(f"wrote {file}")
    output.document({"figures": [str(file) for file in files], "left_out": left_out})


def _files_of(folder: Path | None) -> list[Path]:
    return sorted(folder.iterdir()) if folder is not None and folder.is_dir() else []


def _moved(path: Path, source: Path, target: Path) -> Path:
    """Return where a path in a folder is in another one; other paths stay."""
    absolute, start = path.absolute(), source.absolute()
    return target / absolute.relative_to(start) if start in absolute.parents else path


def _is_sweep(directory: Path) -> bool:
    return (directory / "summary.json").is_file() and not (directory / "trajectory.txt").exists()


def _plot_sweep(
    directory: Path, out: Path, kind: str, parameter: str | None, output: Output
) -> Path:
    from dqslam.plot.style import save_figure
    from dqslam.plot.sweep import SUMMARY, draw_sweep, read_summary

    path = out / f"sweep.{kind}"
    check_files(directory, [SUMMARY])
    with output.waiting("drawing"):
        save_figure(draw_sweep(read_summary(directory), parameter), path)
    return path


def _is_changes(directory: Path) -> bool:
    return (directory / CHANGES_FILE).is_file() and not (directory / "trajectory.txt").exists()


def _plot_changes(directory: Path, path: Path, output: Output) -> Path:
    from dqslam.places.changes import read_changes
    from dqslam.plot.changes import plot_changes

    found = read_changes(directory / CHANGES_FILE)
    with output.waiting("drawing"):
        plot_changes(found, path)
    return path


def _overlay(
    results: Results,
    images: dict[int, Path],
    out: Path,
    video: Path | None,
    rate: float | None,
    output: Output,
) -> list[Path]:
    """Write images, by their poses, with the outlines of the map, and return the files."""
    from dqslam.plot.overlay import Overlay, save_stills, save_video

    overlay = Overlay(results)
    with output.share("images") as progress:
        if video is None:
            return save_stills(overlay, images, out / "images", progress)
        save_video(overlay, images, video, rate=rate, progress=progress)
    return [video]


def _choose(frames: str | None, images: dict[int, Path], *, is_film: bool) -> dict[int, Path]:
    """Return the selected images, by default all for a film and else a few."""
    poses = sorted(images)
    if frames is None and (is_film or len(poses) <= _STILLS):
        return {pose: images[pose] for pose in poses}
    if frames is None:
        last = len(poses) - 1
        return {
            pose: images[pose]
            for pose in (poses[round(at * last / (_STILLS - 1))] for at in range(_STILLS))
        }
    asked: set[int] = set()
    for part in frames.split(","):
        asked.update(_span(part.strip()))
    chosen = {pose: images[pose] for pose in poses if pose in asked}
    if not chosen:
        raise ValueError(f"--frames: no image is of a pose among {frames}")
    return chosen


def _span(part: str) -> range:
    """Return the poses of "7", "7-20" or "7-20:5", with both ends."""
    try:
        ends, _, step = part.partition(":")
        first, dash, last = ends.partition("-")
        span = range(int(first), int(last if dash else first) + 1, int(step) if step else 1)
    except ValueError:
        span = range(0)
    if not span:
        raise ValueError(f"--frames: {part!r} is not like 7, 7-20 or 7-20:5")
    return span
