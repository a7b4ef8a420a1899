"""``dqslam shape``: surfaces and relative positions of objects from depth images."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._files import refuse_inputs
from dqslam.cli.options import FrameRate, FrameTimesFile, given_frame_times
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.surface import Surfaces

WRITTEN_BY = "dqslam shape"
_NEEDED = {"skimage": "scikit-image", "trimesh": "trimesh", "PIL": "Pillow"}
# Less of a surface than this was seen: volume and extents are mostly those of the map.
_LEAST_SEEN = 0.6


def shape(
    context: typer.Context,
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="Directory that `dqslam run` wrote.")
    ],
    depth: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER",
            help="Depth images, grey with 16 bits, registered to the camera's images. Their times "
            "come from --frame-times, --frame-rate, their names or their order.",
        ),
    ],
    depth_scale: Annotated[
        float,
        typer.Option(metavar="VALUE", help="Value of a pixel at 1 m: 5000 of TUM, 1000 for mm."),
    ],
    images: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Images that color the surfaces."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FOLDER", help="Directory to write. Default: surfaces in DIR."
        ),
    ] = None,
    positions: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="CSV to write, of measured centers of objects in the camera frame, for `dqslam "
            "run --positions`.",
        ),
    ] = None,
    voxel: Annotated[
        float | None,
        typer.Option(
            metavar="METERS",
            help="Side of a voxel, meters. Default: from the object's size and the depth noise.",
        ),
    ] = None,
    margin: Annotated[
        float,
        typer.Option(help="How much further than its ellipsoid an object may reach, as a share."),
    ] = 0.5,
    depth_noise: Annotated[
        float,
        typer.Option(
            metavar="METERS",
            help="Sigma of depth at 1 m; it grows with the square of the distance.",
        ),
    ] = 0.002,
    closed: Annotated[
        bool,
        typer.Option(
            "--closed", help="Close meshes where no image has seen the object. Default: open there."
        ),
    ] = False,
    frame_times: FrameTimesFile = None,
    frame_rate: FrameRate = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Fuse the surfaces of the objects in DIR from depth images, as PLY and GLB.

    It needs the extra "surface". docs/surface.md describes the files, and what they do not tell.
    """
    missing = [name for module, name in _NEEDED.items() if find_spec(module) is None]
    if missing:
        raise ValueError(f"surfaces need {', '.join(missing)}: pip install 'dqslam[surface]'")
    from dqslam import io, surface
    from dqslam._outputs import belongs_to, check_output_set, output_set
    from dqslam.surface import files

    output = Output(quiet=quiet, as_json=json)
    out = directory / files.FOLDER if out is None else out
    inputs = (depth, images, frame_times, config)
    if positions is not None:
        refuse_inputs(positions, (*inputs, *_files_in(directory), *_files_in(depth)))
    check_output_set(out, WRITTEN_BY, inputs=(directory / "map.json", *inputs))
    options = surface.SurfaceOptions(
        voxel=voxel, margin=margin, depth_noise=depth_noise, closed=closed
    )
    with output.waiting("reading"):
        results = io.load_results(directory)
        times = given_frame_times(frame_times, frame_rate)
        camera = results.camera
        found_depth = surface.read_depth_images(
            depth, depth_scale, camera, results.timestamps, times
        )
        found_colors = None
        if images is not None:
            found_colors = surface.read_color_images(images, camera, results.timestamps, times)
    measured = None
    with output_set(out, WRITTEN_BY, inputs=(directory / "map.json", *inputs)) as folder:
        with output.share("fusing") as progress:
            found = surface.fuse_surfaces(
                results,
                found_depth,
                found_colors,
                options,
                depth_scale=depth_scale,
                progress=progress,
            )
        if positions is not None:
            with output.share("positions") as progress:
                measured = surface.relative_positions(
                    results, found_depth, found, progress=progress
                )
        with output.share("writing") as progress:
            surface.write_surfaces(folder, found, progress)
        save_settings(context, folder / CONFIG)
    belongs_to(directory, out)
    if positions is not None and measured is not None:
        surface.write_positions(positions, results, measured)
    output.table(_table(found))
    for number, why in found.left_out.items():
        output.warn(f"object {number} has no surface: {why}")
    if found.images_left_out:
        output.warn(f"{found.images_left_out} depth images are not of the time of the path")
    for one in found.surfaces:
        if one.seen_share < _LEAST_SEEN:
            output.warn(
                f"object {one.object_id}: images saw {100 * one.seen_share:.0f}% of its surface; "
                "its volume and extents rest on the map elsewhere"
            )
    if measured is not None:
        output.line(f"wrote {positions}: {len(measured)} positions of objects")
    output.line(f"wrote {out}")
    document = files.described(found)
    if measured is not None:
        document["positions"] = len(measured)
    output.document(document | {"written": str(out)})


def _files_in(folder: Path) -> list[Path]:
    return [one for one in folder.iterdir() if one.is_file()] if folder.is_dir() else []


def _table(found: "Surfaces") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD)
    for name in ("id", "class", "images", "voxel, mm", "faces", "volume, l", "extents, m"):
        table.add_column(name, justify="left" if name == "class" else "right")
    table.add_column("seen", justify="right")
    for one in found.surfaces:
        table.add_row(
            str(one.object_id),
            escape(one.class_name),
            str(one.images),
            f"{1e3 * one.voxel:.1f}",
            str(len(one.faces)),
            f"{1e3 * one.volume:.3g}",
            " x ".join(f"{side:.3f}" for side in one.extents),
            f"{100 * one.seen_share:.0f}%",
        )
    return table
