"""``dqslam align``: the motion between two maps of one place."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dqslam._outputs import output_set
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.places import Alignment

CANNOT_TELL = 3  # exit code of a question that the maps leave open

MAP_HELP = "A folder of results, a map.json, or a CSV of class_id,x,y,z."
MotionOption = Annotated[
    Literal["auto", "se2", "se3"],
    typer.Option(
        help="se2: both maps have z up; se3: they may be tilted; auto: se2 first, then se3."
    ),
]
SigmaOption = Annotated[
    float | None,
    typer.Option(
        help="Error of a center in meters, in maps without covariances. Default: a twentieth of "
        "the room that an object has."
    ),
]


def align(
    context: typer.Context,
    a: Annotated[Path, typer.Argument(metavar="A", help=MAP_HELP)],
    b: Annotated[Path, typer.Argument(metavar="B", help="Another map.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DIR",
            help="Directory for alignment.json; new, or of this command.",
        ),
    ] = None,
    motion: MotionOption = "auto",
    scale: Annotated[
        bool, typer.Option("--scale", help="The units of length of the maps may differ.")
    ] = False,
    sigma: SigmaOption = None,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Find how two maps of one place lie to each other, by the objects that both have.

    Writes alignment.json: b_from_a takes coordinates of A into B. Exits with 3, and writes nothing,
    if the maps do not say whether or how they belong together. docs/places.md describes the method.
    """
    from dqslam import places
    from dqslam.io.files import write_json

    output = Output(quiet=quiet, as_json=json)
    try:
        with output.waiting("aligning"):
            found = places.align(a, b, motion=motion, scale=scale, sigma=sigma)
    except places.CannotTellError as error:
        output.warn(f"cannot tell whether {a} and {b} are of one place: {error}")
        raise typer.Exit(CANNOT_TELL) from None
    content = places.describe_alignment(found, str(a), str(b))
    if out is not None:
        with output_set(out, "dqslam align", inputs=[a, b]) as folder:
            write_json(folder / places.ALIGNMENT_FILE, content)
            save_settings(context, folder / CONFIG)
    output.document(content)
    output.table(_table(found))
    for sentence in found.assumptions:
        output.line(f"assumed: {sentence}")
    if out is not None:
        output.line(f"wrote {out / places.ALIGNMENT_FILE}")


def _table(found: "Alignment") -> "Table":
    import numpy as np
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from scipy.spatial.transform import Rotation

    table = Table(box=SIMPLE_HEAD, show_header=False)
    sigma = np.sqrt(np.diag(found.covariance))
    turn = np.degrees(Rotation.from_matrix(found.b_from_a[:3, :3] / found.scale).as_rotvec())
    shift = ", ".join(f"{x:.3f}" for x in found.b_from_a[:3, 3])
    rows = {
        "objects in both": f"{len(found)}, {found.rms_m:.3f} m apart (rms)",
        "translation": f"({shift}) m ± ({', '.join(f'{x:.3f}' for x in sigma[:3])}) m",
        "rotation vector": f"({', '.join(f'{x:.2f}' for x in turn)}) degrees "
        f"± ({', '.join(f'{x:.2f}' for x in np.degrees(sigma[3:]))})",
        "evidence": f"{found.evidence:.1f} (log odds)",
    }
    if found.scale_sigma > 0.0:
        rows["scale"] = f"{found.scale:.4f} ± {found.scale * found.scale_sigma:.4f}"
    if found.runner_up is not None:
        rows["runner-up"] = (
            f"{found.runner_up.pairs} objects, evidence {found.runner_up.evidence:.1f}; "
            f"lead {found.lead:.1f}"
        )
    for name, text in rows.items():
        table.add_row(name, text)
    return table
