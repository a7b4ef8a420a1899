"""Results as tables for people."""

from collections.abc import Iterator, Sequence
from statistics import median
from typing import TYPE_CHECKING

from benchmarks.compare import DQSLAM, Change
from benchmarks.results import Linearized, Measured, Results, spread

if TYPE_CHECKING:
    from rich.table import Table

_NONE = "-"


def tables(results: Results) -> Iterator["Table"]:
    """Lay out what was measured: speed, iterations, answers, then C++."""
    if results.measured:
        yield speed_table(results)
        yield iteration_table(results)
        yield answer_table(results)
        if any(run.step_ms for one in results.measured for run in one.runs):
            yield step_table(results)
    if results.linearized:
        yield linearized_table(results.linearized)


def speed_table(results: Results) -> "Table":
    """Lay out times and memory of each case and program."""
    columns = ("build", "start", "solve", "total", "least", "greatest", "wall s", "over dqslam")
    title = "Speed: CPU seconds, medians; total with its spread; wall clock; total over dqslam's"
    table = _table(title, "case", "program", *columns, "peak MB")
    for one in results.measured:
        if one.failure:
            table.add_row(one.case, one.program, "failed")
            continue
        reference = results.find(one.case, DQSLAM)
        ratio = f"{one.cpu_s()[0] / reference.cpu_s()[0]:.2f}" if reference else _NONE
        table.add_row(
            one.case,
            one.program,
            *(_stage(one, stage) for stage in ("build", "start", "solve")),
            *(f"{seconds:.3g}" for seconds in (*one.cpu_s(), one.wall_s()[0])),
            ratio,
            f"{one.peak_mb:.0f}",
        )
    return table


def failures(results: Results) -> Iterator[str]:
    """Say which programs gave no answer, and why."""
    for one in results.measured:
        if one.failure:
            yield f"{one.program} failed on {one.case}: {one.failure}"


def iteration_table(results: Results) -> "Table":
    """Lay out where the time of solving goes, as far as programs tell."""
    columns = ("iterations", "ms each", "evaluate", "factor", "other")
    title = "Iterations: wall ms of each, and its parts"
    table = _table(title, "case", "program", *columns)
    for one in results.measured:
        if not one.failure:
            table.add_row(one.case, one.program, *_iterations(one))
    return table


def step_table(results: Results) -> "Table":
    """Lay out what one step takes, of the programs that go step by step; medians of the runs."""
    names = ("p50", "p99", "worst", "total")
    table = _table("Steps: wall ms", "case", "program", *names)
    for one in results.measured:
        runs = [run.step_ms for run in one.runs if run.step_ms]
        if runs:
            values = (f"{median(run[name] for run in runs):.3g}" for name in names)
            table.add_row(one.case, one.program, *values)
    return table


def answer_table(results: Results) -> "Table":
    """Lay out how good the answers are: speed shall not hide a worse one."""
    columns = ("poses", "objects", "boxes", "RMSE m", "aligned m", "centers m", "boxes px")
    table = _table("Answers", "case", "program", *columns, "impossible", "cost")
    for one in results.measured:
        score = one.runs[-1].score
        if one.failure or score is None:
            continue
        table.add_row(
            one.case,
            one.program,
            *(str(one.size[name]) for name in ("poses", "objects", "boxes")),
            *(f"{error:.3g}" for error in (score.rmse_m, score.aligned_rmse_m)),
            *(f"{error:.3g}" for error in (score.center_rmse_m, score.box_rms_px)),
            str(score.impossible_boxes),
            f"{one.runs[-1].cost:.6g}",
        )
    return table


def linearized_table(linearized: Sequence[Linearized]) -> "Table":
    """Lay out the C++ benchmark."""
    table = _table("Residuals and Jacobians", "measurement", "CPU ns (least, greatest)")
    for one in linearized:
        middle, least, greatest = spread(list(one.cpu_ns))
        table.add_row(one.name, f"{middle:.0f} ({least:.0f}, {greatest:.0f})")
    return table


def change_table(changes: Sequence[Change]) -> "Table":
    """Lay out a comparison with a baseline."""
    table = _table("Now over baseline", "case", "CPU", "measured by", "memory", "complaints")
    for one in changes:
        table.add_row(
            one.case,
            f"{one.cpu:.2f}",
            one.yardstick or "the clock",
            f"{one.memory:.2f}",
            ", ".join(one.complaints) or "none",
        )
    return table


def _stage(one: Measured, stage: str) -> str:
    return f"{one.cpu_s(stage)[0]:.3g}" if stage in one.runs[0].stages else _NONE


def _iterations(one: Measured) -> list[str]:
    """Return iterations, wall milliseconds of each, and their parts where the program tells."""
    last = one.runs[-1]
    if not last.iterations:
        return [str(last.iterations), *[_NONE] * 4]
    whole = one.wall_s("solve")[0]
    parts = []
    for name in ("evaluation_seconds", "linear_solver_seconds"):
        told = [value for run in one.runs if (value := getattr(run, name)) is not None]
        parts.append(median(told) if told else None)
    known = [part for part in parts if part is not None]
    other = whole - sum(known) if len(known) == len(parts) else None
    per = 1e3 / last.iterations
    shown = [whole, *parts, other]
    return [
        str(last.iterations),
        *(_NONE if seconds is None else f"{seconds * per:.3g}" for seconds in shown),
    ]


def _table(title: str, *headings: str) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left")
    for heading in headings:
        words = heading in ("case", "program", "measurement", "measured by", "complaints")
        table.add_column(heading, justify="left" if words else "right", no_wrap=True)
    return table
