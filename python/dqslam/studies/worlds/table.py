"""The table of the worlds: as cells, as Markdown, and as files."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dqslam._version import version
from dqslam.io.files import FileError, read_text, write_json, write_text
from dqslam.studies.paper import Statistics
from dqslam.studies.worlds.battery import WORLDS
from dqslam.studies.worlds.rows import RowName
from dqslam.studies.worlds.summary import RowSummary, WorldsSummary, WorldSummary
from dqslam.studies.worlds.trial import WorldTrial

NUMBERS = (
    "optimum",
    "lost",
    "says converged",
    "positions, m",
    "odometry, m",
    "worse",
    "error / bound",
    "NEES poses",
    "NEES centers",
    "failed",
)
"""The columns of the table after the world and the row."""
BEGIN, END = "<!-- table of the worlds -->", "<!-- end of the table -->"
"""The marks around the table in a page."""


def cells(world: WorldSummary, row: RowSummary) -> list[str]:
    """Return one line of the table, a text for each of NUMBERS."""
    compared, failed = row.compared, len(row.failures) + len(row.score_failures)
    return [
        f"{row.at_optimum} of {compared}" if compared else "",
        str(len(row.lost)) if compared else "",
        str(len(row.lost_converged)) if compared else "",
        _spread(row.positions),
        number(world.odometry.avg),
        str(len(row.worse_than_odometry)),
        number(row.error_over_bound),
        _mean_and_median(row.pose_nees),
        _mean_and_median(row.center_nees),
        str(failed) if failed else "",
    ]


def markdown(summary: WorldsSummary) -> str:
    """Return the table in Markdown, under a line that says what made it."""
    seeds, names = summary.seeds, ("world", "", *NUMBERS)
    lines = [
        f"dqslam {version() or '(not installed)'}, seeds {seeds[0]} to {seeds[-1]}.",
        "",
        f"| {' | '.join(names)} |",
        "|---" * len(names) + "|",
    ]
    for part, worlds in _parts(summary):
        if part:
            lines.append(f"| **{part}** |" + " |" * (len(names) - 1))
        for world in worlds:
            for number, (name, row) in enumerate(world.rows.items()):
                title = f"`{world.scenario.name}`: {world.scenario.title}" if not number else ""
                lines.append(f"| {' | '.join((title, name, *cells(world, row)))} |")
    return "\n".join(lines) + "\n"


def around_table(page: Path) -> tuple[str, str]:
    """Return what stands before and after the table of a page, both with their mark.

    Raises
    ------
    FileError
        If the page does not have both marks.
    """
    before, begin, rest = read_text(page).partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise FileError(page, f"has no place for a table: {BEGIN} and {END}")
    return before + begin, end + after


def replace_table(page: Path, summary: WorldsSummary) -> None:
    """Put the table between the two marks of a page; see `around_table` for errors."""
    before, after = around_table(page)
    write_text(page, f"{before}\n\n{markdown(summary)}\n{after}")


def _parts(summary: WorldsSummary) -> Iterator[tuple[str, list[WorldSummary]]]:
    """Yield the worlds by the parts of the battery, and at the end those that are of none."""
    left = list(summary.worlds)
    for part, names in WORLDS.items():
        own = [world for world in left if world.scenario.name in names]
        if own:
            left = [world for world in left if world.scenario.name not in names]
            yield part, own
    if left:
        yield "", left


def save_results(summary: WorldsSummary, folder: Path) -> tuple[Path, ...]:
    """Write worlds.json, worlds.md and trials.csv; return the files, the JSON last."""
    write_text(folder / "worlds.md", markdown(summary))
    write_text(folder / "trials.csv", _csv(summary.trials))
    write_json(folder / "worlds.json", summary.as_dict())
    return folder / "worlds.md", folder / "trials.csv", folder / "worlds.json"


_COLUMNS = (
    "position_error",
    "center_error",
    "mapped",
    "bound",
    "pose_nees",
    "center_nees",
    "excess_cost",
    "is_optimum",
    "converged",
    "failure",
    "score_failure",
)


def _csv(trials: tuple[WorldTrial, ...]) -> str:
    """Return a row for each trial and row of the table; numbers that there are not are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("world", "seed", "row", "odometry_error", *_COLUMNS))
    for trial in trials:
        name: RowName
        for name, one in trial.rows.items():
            values = (getattr(one, column) for column in _COLUMNS)
            writer.writerow(
                (trial.world, trial.seed, name, trial.odometry_error, *map(_cell, values))
            )
    return text.getvalue()


def _cell(value: float | bool | str | None) -> float | int | str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return int(value) if isinstance(value, bool) else value


def _spread(values: Statistics) -> str:
    return " / ".join(map(number, (values.avg, values.med, values.max)))


def _mean_and_median(values: Statistics) -> str:
    return " / ".join(map(number, (values.avg, values.med)))


def number(value: float) -> str:
    """Write a number of a table; nothing for NaN."""
    if not np.isfinite(value):
        return ""
    for limit, digits in ((9.995, 2), (99.95, 1), (99999.5, 0)):
        if abs(value) < limit:
            return f"{value:.{digits}f}"
    return f"{value:.0e}"
