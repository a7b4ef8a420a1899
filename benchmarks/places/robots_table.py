"""The tables of maps that are aligned and merged: simulated pairs of robots, and real maps."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from benchmarks.places import merging, real


def merge_pairs(
    trials: Annotated[int, typer.Option(min=1, help="Pairs of robots.")] = 60,
    seed: Annotated[int, typer.Option(min=0, help="Of the first pair.")] = 0,
    solves: Annotated[
        bool, typer.Option("--solve/--fuse", help="With the problems of both maps, or without.")
    ] = True,
) -> None:
    """Merge the maps of two simulated robots: how often, how well, and how honestly."""
    found = []
    for number in range(seed, seed + trials):
        found.append(merging.run(number, solves=solves))
        one = found[-1]
        told = one.refused or f"aligned, {one.shift_m:.3f} m off, NEES / 3 {one.nees:.2f}"
        typer.echo(f"== {number}: {told}", err=True)
    _show(found)


def align_real(
    trials: Annotated[int, typer.Option(min=1, help="Draws of a frame for each pair.")] = 20,
) -> None:
    """Align published maps of one place, turned and shifted at random."""
    say = _printer()
    say("| maps | | off the reference | turn [deg] | shift [m] |\n|---|---|---|---|---|")
    for place in real.PLACES:
        for row in real.rows(place, trials):
            say(row)


def _show(found: list[merging.Trial]) -> None:
    aligned = [one for one in found if not one.refused]
    say = _printer()
    say(f"pairs of robots: {len(found)}, refused: {len(found) - len(aligned)}")
    if not aligned:
        return
    twice, wrong = (sum(getattr(one, name) for one in aligned) for name in ("twice", "wrong"))
    say(f"objects of both that the merged map has twice: {twice}; two taken for one: {wrong}")
    better = [int(np.argmin(one.aligned_m)) for one in aligned]  # known by the truth only
    rows = {
        "turn of the alignment, error [deg]": [abs(one.turn_deg) for one in aligned],
        "common objects, error of the alignment [m]": [one.shift_m for one in aligned],
        "**in the frame of a robot**: first map alone [m]": [one.single_m[0] for one in aligned],
        "its objects in the merged map [m]": [one.merged_at[0] for one in aligned],
        "second map alone [m]": [one.single_m[1] for one in aligned],
        "its objects in the merged map, as it lies to the second [m]": [
            one.merged_at[1] for one in aligned
        ],
        "**after the best rigid motion**: first map alone [m]": [
            one.aligned_m[0] for one in aligned
        ],
        "the objects of the first in the merged map [m]": [
            one.merged_aligned[0] for one in aligned
        ],
        "the second map alone [m]": [one.aligned_m[1] for one in aligned],
        "the objects of the second in the merged map [m]": [
            one.merged_aligned[1] for one in aligned
        ],
        "the better one of both alone [m]": [
            one.aligned_m[row] for one, row in zip(aligned, better, strict=True)
        ],
        "the objects of the better one in the merged map [m]": [
            one.merged_aligned[row] for one, row in zip(aligned, better, strict=True)
        ],
        "all objects of the merged map [m]": [one.merged_all_aligned for one in aligned],
        "**NEES / 3** of merged centers": [one.nees for one in aligned],
        "of the first map alone": [one.single_nees[0] for one in aligned],
        "of the second map alone": [one.single_nees[1] for one in aligned],
    }
    say("| | mean | median | largest |\n|---|---|---|---|")
    for name, values in rows.items():
        say(f"| {name} | {np.mean(values):.3f} | {np.median(values):.3f} | {max(values):.3f} |")
    nearer = np.array([np.less(one.merged_aligned, one.aligned_m) for one in aligned])
    best = nearer[np.arange(len(aligned)), better]
    say(
        f"after the best rigid motion, the merged map is nearer to the truth than {nearer.sum()} "
        f"of {nearer.size} maps alone, and than {best.sum()} of {best.size} better ones of both"
    )


def _printer() -> partial[None]:
    return partial(Console(soft_wrap=True).print, markup=False, highlight=False)
