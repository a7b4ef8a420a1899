"""Changes that ``dqslam changes`` finds, counted: in simulated rooms, and in halves of a tour."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import dqslam as dq
from benchmarks.places import rooms

MOVED_M = (0.3, 2.0)


def count_changes(
    count: Annotated[int, typer.Option(help="Rooms.")] = 100,
    seed: Annotated[int, typer.Option(help="Of the first room.")] = 0,
    images: Annotated[int, typer.Option(help="Of each visit.")] = 60,
    verbose: bool = False,
) -> None:
    """Move 20 % of the objects by 0.3 to 2 m, take away 10 %, add 10 %; count what is found."""
    counts: Counter[tuple[str, str]] = Counter()
    for number in range(seed, seed + count):
        random = np.random.default_rng(number)
        room = rooms.draw_room(random)
        after, truth = change(room, random)
        first, first_rows = rooms.map_with_rows(room, images, random)
        second, second_rows = rooms.map_with_rows(after, images, random)
        found = dq.changes(first, second)
        for one in found.objects:
            for true, told in _judged(one, truth, first_rows, second_rows):
                counts[true, told] += 1
                if verbose and told not in (true, "unknown"):
                    typer.echo(f"{number}: {true}, found {one}")
    _show(f"{count} rooms from seed {seed}", counts)


def change(room: rooms.Room, random: np.random.Generator) -> tuple[rooms.Room, dict[str, set[int]]]:
    """Change a room; the rows of objects stay the same, new ones are at the end.

    Objects that are gone are far away, where no camera looks.
    """
    rows = random.permutation(len(room.class_id))
    share = max(1, round(0.1 * len(rows)))
    moved, gone = rows[: 2 * share], rows[2 * share : 3 * share]
    centers = room.centers.copy()
    angle = random.uniform(0.0, 2.0 * np.pi, len(moved))
    distance = random.uniform(*MOVED_M, len(moved))
    centers[moved, 0] += distance * np.cos(angle)
    centers[moved, 1] += distance * np.sin(angle)
    centers[gone] += [0.0, 0.0, -1000.0]
    new = rooms.draw_objects(room, share, random)
    truth = {
        "moved": set(moved.tolist()),
        "vanished": set(gone.tolist()),
        "appeared": set(range(len(rows), len(rows) + share)),
    }
    return rooms.join(replace(room, centers=centers), new), truth


def _judged(
    one: dq.Change, truth: dict[str, set[int]], first: np.ndarray, second: np.ndarray
) -> list[tuple[str, str]]:
    """Return what is true and what was found of an object, or of two that were taken for one."""
    a = None if one.first_id is None else int(first[one.first_id])
    b = None if one.second_id is None else int(second[one.second_id])
    rows = {row for row in (a, b) if row is not None}
    told = one.status if len(rows) == 1 else "mismatched"
    true = [next((s for s, own in truth.items() if row in own), "stayed") for row in rows]
    return [(status, told) for status in true]


def _show(title: str, counts: Counter[tuple[str, str]]) -> None:
    statuses = ("stayed", "moved", "vanished", "appeared", "unknown", "mismatched")
    table = Table(title=title)
    for name in ("truly", *statuses, "precision", "recall", "F1"):
        table.add_column(name, justify="right")
    for true in statuses[:4]:
        row = [counts[true, status] for status in statuses]
        right = counts[true, true]
        said = sum(number for (_, status), number in counts.items() if status == true)
        # Two objects that are taken for one that moved are a wrong motion.
        said += sum(counts[other, "mismatched"] for other in statuses) // 2 * (true == "moved")
        # What nobody looked at cannot be told, and is no miss: "unknown" counts apart.
        real = sum(row) - counts[true, "unknown"]
        precision, recall = right / max(said, 1), right / max(real, 1)
        f1 = 2.0 * precision * recall / max(precision + recall, 1e-9)
        cells = [f"{number:.3f}" for number in (precision, recall, f1)]
        table.add_row(true, *map(str, row), *cells)
    Console(width=110).print(table)


def compare_halves(
    camera: Annotated[Path, typer.Option()],
    odometry: Annotated[Path, typer.Option()],
    detections: Annotated[Path, typer.Option()],
    seeds: Annotated[int, typer.Option(help="Runs with other noise of odometry.")] = 10,
    noise: str = "translation=0.003,rotation=0.002",
    ids: str = "none",
    out: Path = Path("results/halves"),
) -> None:
    """Map both halves of a recording from its poses, with noise, and print what changed."""
    from dqslam.cli import main

    lines = [line for line in odometry.read_text().splitlines() if line and line[0] != "#"]
    middle = len(lines) // 2
    out.mkdir(parents=True, exist_ok=True)
    for seed in range(seeds):
        folders = []
        for name, part in (("first", lines[:middle]), ("second", lines[middle:])):
            path = out / f"{name}.txt"
            path.write_text("\n".join(part) + "\n")
            folder = out / f"{name}-{seed}"
            folders.append(folder)
            given = ["run", "--camera", camera, "--odometry", path, "--detections", detections]
            given += ["--ids", ids, "--out", folder, "--quiet", "--force"]
            if noise:
                given += ["--perturb-odometry", noise, "--seed", seed]
            if main(list(map(str, given))) not in (0, 3):
                raise typer.Exit(1)
        found = dq.changes(*folders)
        told = [f"{one.status} {one.class_name} {one.probability:.2f}" for one in found.objects]
        typer.echo(f"{seed}: {found} {'; '.join(told)}")
