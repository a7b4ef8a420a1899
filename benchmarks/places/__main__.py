"""``python -m benchmarks.places``: the tables of docs/places.md."""

from __future__ import annotations

import sys
from functools import partial
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from benchmarks.places import merging, real

_CASES = ("robots", "real")


def places(
    case: Annotated[str, typer.Argument(help=f"One of {', '.join(_CASES)}.")] = "robots",
    trials: Annotated[int, typer.Option(min=1, help="Pairs of robots, or draws of a frame.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of the first pair.")] = 0,
) -> None:
    """Measure how often maps of two robots are aligned, and how good the merged map is."""
    if case not in _CASES:
        raise typer.BadParameter(f"no case {case!r}; there are: {', '.join(_CASES)}")
    if case == "real":
        say = partial(Console(soft_wrap=True).print, markup=False, highlight=False)
        say("| maps | | turn [deg] | shift [m] |\n|---|---|---|---|")
        for place in real.PLACES:
            for row in real.pairs(place, trials):
                say(row)
        return
    found = []
    for number in range(seed, seed + trials):
        found.append(merging.run(number))
        sys.stderr.write(f"== {number}: {found[-1].refused or 'aligned'}\n")
    show(found)


def show(found: list[merging.Trial]) -> None:
    """Print the table of all pairs."""
    aligned = [one for one in found if not one.refused]
    say = partial(Console(soft_wrap=True).print, markup=False, highlight=False)
    say(f"pairs of robots: {len(found)}, refused: {len(found) - len(aligned)}")
    if not aligned:
        return
    rows = {
        "turn of the alignment, error [deg]": [abs(one.turn_deg) for one in aligned],
        "common objects, error of the alignment [m]": [one.shift_m for one in aligned],
        "NEES of merged centers / 3": [one.nees for one in aligned],
        "merged centers, error [m]": [one.merged_m for one in aligned],
        "first map alone [m]": [one.single_m[0] for one in aligned],
        "second map alone [m]": [one.single_m[1] for one in aligned],
    }
    say("| | mean | median | largest |\n|---|---|---|---|")
    for name, values in rows.items():
        say(f"| {name} | {np.mean(values):.3f} | {np.median(values):.3f} | {max(values):.3f} |")


if __name__ == "__main__":
    typer.run(places)
