"""``dqslam changes``: what has changed between two maps of one place."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dqslam.cli.align import CANNOT_TELL
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam._checks import Floats
    from dqslam.places.changes import Changes

_STYLES = {"moved": "yellow", "vanished": "red", "appeared": "green", "unknown": "dim"}


def changes(
    first: Annotated[Path, typer.Argument(metavar="A", help="Directory of the map before.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Directory of the map after.")],
    b_from_a: Annotated[
        Path | None,
        typer.Option(
            help="JSON file with b_from_a, 4 x 4, and covariance, 6 x 6, of the frames, as "
            "`dqslam align` writes it. Default: the objects tell whether both maps have one "
            "frame, and else how they are aligned."
        ),
    ] = None,
    one_frame: Annotated[
        bool,
        typer.Option("--one-frame", help="Both maps have one frame, whatever the objects tell."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Directory for changes.csv, changes.json and changes.png.",
        ),
    ] = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Tell which objects stayed, moved, vanished or appeared, or that nobody looked.

    Both maps need the boxes that `run` writes beside them: an object has vanished only if the
    cameras of B looked at its place and should have found it. docs/locate.md describes the table.
    Exits with 3, and writes nothing, if the objects do not tell how the maps lie to each other.
    """
    from dqslam._outputs import output_set
    from dqslam.cli.results import draw_figure
    from dqslam.places import CannotTellError
    from dqslam.places.changes import changes as find_changes
    from dqslam.places.changes.files import described, read_alignment, write_changes

    output = Output(quiet=quiet, as_json=json)
    if one_frame and b_from_a is not None:
        raise typer.BadParameter("--one-frame and --b-from-a contradict each other")
    pose: Floats | Literal["find"] | None = None if one_frame else "find"
    covariance = None
    if b_from_a is not None:
        pose, covariance = read_alignment(b_from_a)
    try:
        with output.waiting("comparing"):
            found = find_changes(first, second, second_from_first=pose, covariance=covariance)
    except CannotTellError as error:
        output.warn(
            f"cannot tell how {first} and {second} lie to each other: {error}; "
            "--one-frame or --b-from-a says it"
        )
        raise typer.Exit(CANNOT_TELL) from None
    why_not = ""
    if out is not None:
        with output_set(out, "dqslam changes", inputs=(first, second, b_from_a)) as folder:
            write_changes(folder, found)

            def draw(path: Path) -> None:
                from dqslam.plot.changes import plot_changes

                plot_changes(found, path)

            why_not = draw_figure(output, folder / "changes.png", draw)
    output.table(_table(found))
    if found.frame:
        output.line(f"frames: {found.frame}")
    output.line(str(found))
    if out is not None:
        output.line(why_not or f"wrote {out}")
    output.document(described(found))


def _table(found: "Changes") -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    from dqslam.places.changes.files import distance_and_sigma

    table = Table(box=SIMPLE_HEAD)
    for name in ("object", "class", "", "probability", "from, m", "to, m", "moved, m", "looks"):
        table.add_column(name, justify="left" if name in ("class", "") else "right")
    for one in found.objects:
        ids = " ".join(
            f"{which}{number}"
            for which, number in (("A", one.first_id), ("B", one.second_id))
            if number is not None
        )
        distance, sigma = distance_and_sigma(one)
        table.add_row(
            ids,
            escape(one.class_name),
            one.status,
            f"{one.probability:.3f}",
            _place(one.first_center),
            _place(one.second_center),
            "" if distance != distance else f"{distance:.2f} ± {sigma:.2g}",
            f"{one.looks:.1f}",
            style=_STYLES.get(one.status),
        )
    return table


def _place(center: object) -> str:
    return "" if center is None else " ".join(f"{x:.2f}" for x in center)  # type: ignore[attr-defined]
