"""``dqslam merge``: one map and all trajectories of several maps of one place."""

from pathlib import Path
from typing import Annotated

import typer

from dqslam.cli.align import CANNOT_TELL, MAP_HELP, MotionOption, SigmaOption
from dqslam.cli.options import ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, settings_text


def merge(
    context: typer.Context,
    maps: Annotated[list[Path], typer.Argument(metavar="MAP", help=MAP_HELP)],
    out: ResultDirectory,
    motion: MotionOption = "auto",
    sigma: SigmaOption = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Merge maps of one place into one result, in the frame of the first.

    Folders of results that have a graph.npz are solved as one problem; other maps are fused by
    their covariances. Writes map.json and merge.json and, of folders of results, trajectory.txt,
    odometry.txt, camera.json, covariance.csv, boxes.csv and graph.npz: what `dqslam plot`, `view`
    and `evaluate` read. Exits
    with 3, and writes nothing, if a map cannot be aligned with the others.
    """
    from dqslam import places
    from dqslam.io.files import read_text

    output = Output(quiet=quiet, as_json=json)
    beside = {CONFIG: settings_text(context)}
    try:
        with output.waiting("merging"):
            merged = places.merge(*maps, out=out, motion=motion, sigma=sigma, beside=beside)
    except places.CannotTellError as error:
        output.warn(f"not merged: {error}")
        raise typer.Exit(CANNOT_TELL) from None
    for part in merged.parts[1:]:
        pairs = 0 if part.alignment is None else len(part.alignment)
        output.line(f"{part.name}: {pairs} of {len(part.object_ids)} objects are in the map before")
        output.line(f"  fused: {part.why_fused}" if part.why_fused else "  solved together")
    output.line(f"{len(merged.landmarks)} objects, {sum(len(p.poses) for p in merged.parts)} poses")
    if json:
        import json as parser

        output.document(parser.loads(read_text(out / places.MERGE_FILE)))
    output.line(f"wrote {out}")
