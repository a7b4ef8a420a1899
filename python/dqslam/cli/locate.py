"""``dqslam locate``: where a camera is in a map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._input import refuse_shared_input
from dqslam.cli.groups import with_groups
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.reading import ImageOptions
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.places.location.files import ImageLocation

MOST_LISTED = 40


@with_groups
def locate(
    known: Annotated[
        Path,
        typer.Argument(
            metavar="MAP",
            help="Directory that `run` wrote, or a map.json or CSV of objects with their sizes.",
        ),
    ],
    files: ImageOptions,
    odometry: Annotated[
        Path | None,
        typer.Option(
            help="Trajectory between the images, which then vote for one answer. Default: each "
            "image is located alone."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Directory for locations.csv, locations.json and locations.png.",
        ),
    ] = None,
    min_score: Annotated[
        float, typer.Option(help="Leave out boxes with a lower score, 0 to 1.")
    ] = 0.3,
    min_confidence: Annotated[
        float, typer.Option(help="The least probability of an answer.")
    ] = 0.9,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Find where a camera is in MAP, from boxes and their classes, or say why it is not sure.

    Boxes need no ids. Objects may be missing, new, or of wrong classes. docs/locate.md describes
    the answer and its confidence.
    """
    from dqslam import io
    from dqslam._outputs import output_set
    from dqslam.cli.results import draw_figure
    from dqslam.places.location.files import described, locate_files, write_locations

    inputs = (known, *files.files, odometry)
    refuse_shared_input(*inputs[1:])
    output = Output(quiet=quiet, as_json=json)
    reading = files.read_options()
    notes = io.Notes(max_bad=reading.max_bad)
    with output.share("locating") as progress:
        answers = locate_files(
            known,
            files.camera,
            files.detections,
            odometry,
            min_score=min_score,
            min_confidence=min_confidence,
            reading=reading,
            notes=notes,
            progress=progress,
        )
    if out is not None:
        with output_set(out, "dqslam locate", inputs=inputs) as folder:
            write_locations(folder, answers)

            def draw(path: Path) -> None:
                from dqslam.places.landmarks import read_landmarks
                from dqslam.plot.locations import plot_locations

                plot_locations(read_landmarks(known), answers, path)

            why_not = draw_figure(output, folder / "locations.png", draw)
    output.table(_table(answers))
    found = sum(one.location.is_found for one in answers)
    output.line(f"{found} of {len(answers)} located")
    for sentence in notes.sentences():
        output.warn(sentence)
    if out is not None:
        output.line(why_not or f"wrote {out}")
    output.document({"images": [described(one) for one in answers]})


def _table(answers: "list[ImageLocation]") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD)
    for name in ("time, s", "boxes", "position, m", "±, m", "confidence", "no answer because"):
        table.add_column(name, justify="left" if name == "no answer because" else "right")
    for one in answers[:MOST_LISTED]:
        found = one.location
        where, sigma = "", ""
        if found.is_found:
            where = " ".join(f"{x:.2f}" for x in found.pose[:3])
            sigma = f"{float(found.covariance[:3, :3].trace()) ** 0.5:.2g}"
        table.add_row(
            f"{one.timestamp:.3f}",
            str(one.boxes),
            where,
            sigma,
            f"{found.confidence:.4f}",
            escape(found.reason),
        )
    if len(answers) > MOST_LISTED:
        table.add_row("", "", "", "", "", f"and {len(answers) - MOST_LISTED} more")
    return table
