"""``python -m benchmarks.tracks CASE``: the tables of docs/tracks.md."""

from __future__ import annotations

import typer

from benchmarks.tracks import real, simulated

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help="Measure tracks of what moves, a case at a time: CASE --help has its options.",
)
app.command("simulated")(simulated.tabulate)
app.command("real")(real.tabulate)


if __name__ == "__main__":
    app(prog_name="python -m benchmarks.tracks")
