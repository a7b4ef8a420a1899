"""``python -m benchmarks.places CASE``: the tables of docs/places.md and docs/locate.md."""

from __future__ import annotations

import typer

from benchmarks.places import changes, locate, locate_worlds, robots_table, walks

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help="Measure what is found by maps of objects, a case at a time: CASE --help has its options.",
)
for _name, _case in (
    ("robots", robots_table.merge_pairs),
    ("real", robots_table.align_real),
    ("rooms", locate.count_rooms),
    ("worlds", locate_worlds.count_worlds),
    ("walks", walks.count_walks),
    ("recording", locate.locate_recording),
    ("large", locate.locate_in_large_map),
    ("changes", changes.count_changes),
    ("halves", changes.compare_halves),
):
    app.command(_name)(_case)


if __name__ == "__main__":
    app(prog_name="python -m benchmarks.places")
