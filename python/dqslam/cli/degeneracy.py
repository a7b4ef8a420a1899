"""``dqslam degeneracy``: which motions determine an object."""

from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._outputs import output_set
from dqslam.cli.options import MOST_TRIALS, FirstSeed, ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.results import save_study, show_written
from dqslam.cli.settings import ConfigFile

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.studies.degeneracy import DegeneracyTable


def degeneracy(
    context: typer.Context,
    out: ResultDirectory,
    trials: Annotated[
        int, typer.Option(min=1, max=MOST_TRIALS, help="Objects to observe along each motion.")
    ] = 50,
    seed: FirstSeed = 0,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Observe objects along four known motions on the plane, and solve from three starts.

    Writes degeneracy.json, degeneracy.png and config.toml.
    """
    from dqslam.plot.degeneracy import plot_degeneracy
    from dqslam.studies.degeneracy import run_degeneracy

    output = Output(quiet=quiet, as_json=json)
    with output_set(out, "dqslam degeneracy") as folder:
        with output.trials(trials) as progress:
            table = run_degeneracy(trials=trials, seed=seed, progress=progress)
        output.table(_results(table))
        why_not = save_study(context, output, table, folder / "degeneracy.json", plot_degeneracy)
    show_written(output, out / "degeneracy.json", out / "degeneracy.png", why_not)


def _results(table: "DegeneracyTable") -> "Table":
    """Return the table, with a block of the last singular values and all methods per motion."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(title=f"{table.trials} objects a motion, poses known", box=SIMPLE_HEAD)
    shown.add_column("estimator, start", no_wrap=True)
    for heading in ("converged", "ellipsoids", "center, m: 25 %", "median", "75 %"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for motion in table.motions:
        weakest = ", ".join(f"{value:.0e}" for value in motion.singular_values[-3:])
        shown.add_row()
        shown.add_row(motion.motion, style="bold")
        shown.add_row(f"  last singular values {weakest}")
        for row in table.rows:
            if row.motion == motion.motion:
                shown.add_row(
                    f"  {row.estimator}, {row.start}",
                    f"{row.converged:.0%}",
                    f"{row.ellipsoids:.0%}",
                    *(f"{error:.3g}" for error in row.center_error_m),
                )
    return shown
