"""``./run bench``: measure, show, save, and compare with a baseline."""

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from benchmarks import compare, report
from benchmarks.cases import ALL_PROGRAMS, CASES, DEFAULT_CASES, LINEARIZE, ONLINE
from benchmarks.figure import plot_scaling, scaling_cases
from benchmarks.linearize import PROGRAM, linearize
from benchmarks.machine import describe
from benchmarks.measure import (
    ROOT,
    Command,
    dqslam_command,
    measure,
    online_command,
    scipy_command,
)
from benchmarks.peers import PeerMissingError, gtsam_command
from benchmarks.results import Linearized, Measured, Results, load_results, save_results

_WIDTH = 125  # of the tables, characters: in a file they are not squeezed
_PROGRAMS = (*ALL_PROGRAMS, ONLINE)
_HELP = f"Of {', '.join([*CASES, LINEARIZE])}; by default {', '.join(DEFAULT_CASES)}."


def bench(
    cases: Annotated[list[str] | None, typer.Argument(help=_HELP, show_default=False)] = None,
    baseline: Annotated[
        Path | None, typer.Option("--compare", exists=True, dir_okay=False, help="A bench.json.")
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Runs of each program and case.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of the problems.")] = 0,
    noise: Annotated[
        float | None,
        typer.Option(min=1e-6, help="Factor on odometry's noise; default: the case's."),
    ] = None,
    programs: Annotated[
        str, typer.Option(help=f"Separated by commas; {', '.join(_PROGRAMS)}.")
    ] = ",".join(_PROGRAMS),
    threads: Annotated[int, typer.Option(min=1, help="Threads of dqslam's solver.")] = 1,
    limit: Annotated[
        float, typer.Option(min=1.0, help="Seconds of a run; beyond, it fails.")
    ] = 600,
    out: Annotated[Path, typer.Option(help="Directory for bench.json and scaling.png.")] = Path(
        "results/bench"
    ),
) -> None:
    """Measure dqslam and its peers side by side; exit status 1 where a baseline was better."""
    console = Console(width=max(_WIDTH, Console().width))
    cases = cases or list(DEFAULT_CASES)
    _check("case", cases, [*CASES, LINEARIZE])
    chosen = programs.split(",")
    _check("program", chosen, _PROGRAMS)
    before = _baseline(baseline) if baseline else None

    skipped: dict[str, str] = {}
    linearized = _linearized(repeat, skipped) if LINEARIZE in cases else ()
    commands = _commands(chosen, threads, skipped)
    measured: list[Measured] = []
    for name in cases:
        if name != LINEARIZE:
            case = CASES[name]
            solving = {key: commands[key] for key in case.programs if key in commands}
            problem = case.problem(seed, noise)
            measured += measure(name, problem, solving, repeat=repeat, limit_s=limit, progress=_say)
    results = Results(describe(), _version(), seed, tuple(measured), linearized, skipped)
    out.mkdir(parents=True, exist_ok=True)
    save_results(results, out / "bench.json")
    for table in report.tables(results):
        console.print(table)
    for failure in report.failures(results):
        console.print(failure, markup=False)
    for name, reason in skipped.items():
        console.print(f"no {name}: {reason}", markup=False)
    console.print(f"wrote {out / 'bench.json'}", markup=False)
    _plot(results, out / "scaling.png", console)
    if before is not None:
        changes = compare.compare(results, before)
        console.print(report.change_table(changes))
        if results.machine != before.machine:
            console.print("The baseline is of another machine or system.")
        if any(change.complaints for change in changes):
            raise typer.Exit(1)


def _check(what: str, names: list[str], known: list[str] | tuple[str, ...]) -> None:
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"no {what} {name!r}; there are: {', '.join(known)}")


def _baseline(path: Path) -> Results:
    try:
        return load_results(path)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _say(what: str) -> None:
    """Show what goes on, on stderr."""
    sys.stderr.write(f"== {what}\n")


def _commands(chosen: list[str], threads: int, skipped: dict[str, str]) -> dict[str, Command]:
    """Return what runs each program; a peer that is not there is skipped, and why."""
    commands = {}
    for program in chosen:
        if program == "gtsam_quadrics":
            try:
                commands[program] = gtsam_command(_say)
            except PeerMissingError as error:
                skipped[program] = str(error)
        elif program == ONLINE:
            commands[program] = online_command()
        else:
            commands[program] = (
                dqslam_command(threads) if program == compare.DQSLAM else scipy_command()
            )
    return commands


def _linearized(repeat: int, skipped: dict[str, str]) -> tuple[Linearized, ...]:
    try:
        return linearize(repeat)
    except FileNotFoundError:
        skipped[LINEARIZE] = f"{PROGRAM.relative_to(ROOT)} was not built"
        return ()


def _plot(results: Results, path: Path, console: Console) -> None:
    if not scaling_cases(results):
        return
    if find_spec("matplotlib") is None:
        console.print(f"no {path.name}: matplotlib is missing")
        return
    plot_scaling(results, path)
    console.print(f"wrote {path}", markup=False)


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("dqslam")
    except PackageNotFoundError:
        return "not installed"


if __name__ == "__main__":
    typer.run(bench)
