"""``dqslam view``: show a map on a live page, a static page, in Rerun or MeshLab."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._files import refuse_inputs
from dqslam._outputs import belongs_to, check_output_set, output_set
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
    from dqslam.view import Scene


def view(
    context: typer.Context,
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="Directory that `dqslam run` or `dqslam simulate` wrote."
        ),
    ],
    groundtruth: TruthFile = None,
    objects: TrueObjectsFile = None,
    align: Alignment = "se3",
    changes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Show what has changed: the changes.json of `dqslam changes A DIR`.",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(metavar="PAGE", help="Write a folder for any web server, and stop."),
    ] = None,
    images: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Show these images behind the boxes of the page of --export. Their times come "
            "from --frame-times, from their names, or from their order.",
        ),
    ] = None,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    rerun: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write a Rerun recording, and stop.")
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mcap", help="Write MCAP for Foxglove or Lichtblick, and stop."),
    ] = None,
    foxglove: Annotated[
        bool,
        typer.Option(
            "--foxglove", help="Play over a websocket for Foxglove or Lichtblick, not on a page."
        ),
    ] = False,
    ply: Annotated[
        Path | None, typer.Option(metavar="FILE.ply", help="Write the map as PLY, and stop.")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address of the live page; 0.0.0.0 lets other machines connect.")
    ] = "127.0.0.1",
    port: Annotated[
        int,
        typer.Option(
            min=1, max=65535, help="Port of the live page, or the first free one after it."
        ),
    ] = 8080,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show the map of DIR on a page: trajectory, cameras, objects, boxes, truth. Ctrl-C stops it.

    The live page needs the extra `view`, --rerun needs `rerun`, --mcap and --foxglove need `mcap`.
    --export and --ply need none.
    """
    from dqslam import io
    from dqslam._colors import ESTIMATE
    from dqslam.view import build_scene, rgb, write_mcap, write_rerun
    from dqslam.view.changes import with_changes
    from dqslam.view.page import WRITTEN_BY, write_page_files
    from dqslam.view.photographs import write_photographs
    from dqslam.view.surfaces import has_surfaces, with_surfaces

    output = Output(quiet=quiet, as_json=json)
    if images is not None and export is None:
        raise ValueError("--images are shown by the page of --export only")
    if images is not None and find_spec("PIL") is None:
        raise ValueError("images need Pillow: pip install 'dqslam[plot]'")
    inputs = (directory, groundtruth, objects, changes, images, frame_times)
    read = [*inputs, *(directory.iterdir() if directory.is_dir() else ())]
    for file in (rerun, mcap, ply):
        if file is not None:
            refuse_inputs(file, read)
    if export is not None:
        check_output_set(export, WRITTEN_BY, inputs=inputs)
    with output.waiting("reading"):
        results, truth, true_objects = read_with_truth(directory, groundtruth, objects)
        scene = build_scene(results, groundtruth=truth, objects=true_objects, align=align)
        if changes is not None:
            scene = with_changes(scene, changes)
        if has_surfaces(directory):
            scene = with_surfaces(scene, directory)
        times = given_frame_times(frame_times, frame_rate)
        found = None if images is None else io.find_images(images, results.timestamps, times)
    written: dict[str, str] = {}
    if export is not None:
        with output_set(export, WRITTEN_BY, inputs=inputs) as folder:
            names = None
            if found is not None:
                count = len(results.timestamps)
                with output.share("images") as progress:
                    names = write_photographs(found, results.camera, count, folder, progress)
            write_page_files(scene, folder, images=names)
            save_settings(context, folder / "view.toml")
        belongs_to(directory, export)
        written["page"] = str(export / "index.html")
    if rerun is not None:
        with output.share("writing") as progress:
            write_rerun(scene, rerun, progress)
        written["rerun"] = str(rerun)
    if mcap is not None:
        with output.share("writing") as progress:
            write_mcap(scene, mcap, progress)
        written["mcap"] = str(mcap)
    if ply is not None:
        colors = [rgb(one.color) for one in scene.objects[: len(results.objects)]]
        io.write_ply(ply, results, colors, rgb(ESTIMATE))
        written["ply"] = str(ply)
    for path in written.values():
        output.line(f"wrote {path}")
    if written:
        output.document(written)
    elif foxglove:
        _play(scene, host, port, output)
    else:
        _serve(scene, host, port, output)


def _serve(scene: Scene, host: str, port: int, output: Output) -> None:
    """Show a scene until Ctrl-C."""
    from time import sleep

    from dqslam.view import serve

    try:
        with serve(scene, host=host, port=port) as address:
            output.document({"address": address})
            output.line(f"{address} shows {scene.title}; Ctrl-C stops")
            while True:
                sleep(3600.0)
    except KeyboardInterrupt:  # the usual end
        output.line("stopped")


def _play(scene: Scene, host: str, port: int, output: Output) -> None:
    """Play a scene over a websocket, again and again, until Ctrl-C."""
    from time import sleep

    from dqslam.view import serve_foxglove

    try:
        with serve_foxglove(scene, host, port) as (address, play):
            output.document({"address": address})
            output.line(f"{address} plays {scene.title} for Foxglove; Ctrl-C stops")
            while True:
                play()
                sleep(1.0)
    except KeyboardInterrupt:  # the usual end
        output.line("stopped")
