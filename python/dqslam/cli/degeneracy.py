"""``dqslam degeneracy``: which motions determine an object."""

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam.cli.progress import show_progress

if TYPE_CHECKING:
    from rich.table import Table

    from dqslam.degeneracy import DegeneracyTable


def degeneracy(
    out: Annotated[Path, typer.Option(help="Directory for degeneracy.json and degeneracy.png.")],
    trials: Annotated[int, typer.Option(min=1, help="Objects to see along each motion.")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first of them.")] = 0,
) -> None:
    """Look at objects along four motions on the plane, poses known, and solve from three starts.

    Writes degeneracy.json and degeneracy.png.
    """
    from rich.console import Console

    from dqslam.degeneracy import run_degeneracy

    out.mkdir(parents=True, exist_ok=True)
    with show_progress(trials) as progress:
        table = run_degeneracy(trials=trials, seed=seed, progress=progress)
    table.save(out / "degeneracy.json")
    console = Console()
    console.print(_results(table))
    console.print(f"wrote {out / 'degeneracy.json'}", markup=False)
    if find_spec("matplotlib") is None:
        console.print("no degeneracy.png: matplotlib is missing (pip install 'dqslam[plot]')")
        return
    from dqslam.plot.degeneracy import plot_degeneracy

    plot_degeneracy(table, out / "degeneracy.png")
    console.print(f"wrote {out / 'degeneracy.png'}", markup=False)


def _results(table: "DegeneracyTable") -> "Table":
    """Lay out a block for each motion: its weakest singular values, then all methods."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(title=f"{table.trials} objects a motion, poses known", box=SIMPLE_HEAD)
    shown.add_column("estimator, start", no_wrap=True)
    for heading in ("converged", "ellipsoids", "centre, m: 25 %", "median", "75 %"):
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
