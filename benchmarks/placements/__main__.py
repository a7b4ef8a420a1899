"""``python -m benchmarks.placements CASE``: the tables of docs/placements.md."""

from __future__ import annotations

import typer

from benchmarks.placements import real, simulated

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help="Measure rules of placement, a case at a time: CASE --help has its options.",
)
app.command("simulated")(simulated.tabulate)
app.command("real")(real.tabulate)


if __name__ == "__main__":
    app(prog_name="python -m benchmarks.placements")
