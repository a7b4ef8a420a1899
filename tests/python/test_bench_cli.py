"""The command of the benchmarks."""

from dataclasses import replace

import pytest
import typer
from benchmarks import __main__ as command_line
from benchmarks import measure
from benchmarks.cases import CASES, Case
from benchmarks.programs import run_dqslam, run_scipy
from benchmarks.results import Run, load_results, save_results
from typer.testing import CliRunner

from bench import tiny


def in_one_line(result):
    """Undo the frame and the line breaks around a message."""
    return " ".join(result.output.replace("│", " ").split())


@pytest.fixture
def app(monkeypatch):
    """Give the command with a tiny case, solved in this process."""
    case = Case(lambda seed, noise: tiny(seed, noise), noise=0.1)
    monkeypatch.setitem(CASES, "tiny", case)
    programs = {"dqslam": run_dqslam, "scipy": run_scipy}

    def in_place(command, problem, given, answer, limit_s):
        programs[command[-1].rpartition("run_")[2]].main(str(given), str(answer))
        return measure.read_answer(problem, answer)

    monkeypatch.setattr(measure, "run_once", in_place)
    application = typer.Typer()
    application.command()(command_line.bench)
    return application


def test_bench_writes_results_that_compare_with_themselves(app, tmp_path):
    options = ["tiny", "--repeat", "2", "--programs", "dqslam", "--out", str(tmp_path)]
    first = CliRunner().invoke(app, options)
    assert first.exit_code == 0, first.output
    written = load_results(tmp_path / "bench.json")
    assert written.measured[0].size["poses"] == 60
    assert len(written.measured[0].runs) == 2
    costs = {run.cost for run in written.measured[0].runs}
    assert len(costs) == 1
    worst = replace(written, measured=(replace(written.measured[0], runs=(Run(failure="no"),)),))
    save_results(worst, tmp_path / "then.json")
    compared = CliRunner().invoke(app, [*options, "--compare", str(tmp_path / "then.json")])
    assert compared.exit_code == 0, compared.output


def test_a_broken_baseline_is_refused(app, tmp_path):
    (tmp_path / "then.json").write_text("{}", encoding="utf-8")
    refused = CliRunner().invoke(app, ["tiny", "--compare", str(tmp_path / "then.json")])
    assert refused.exit_code == 2
    assert "Field required" in in_one_line(refused)


@pytest.mark.parametrize(
    ("options", "message"),
    [(["peer-2"], "no case 'peer-2'"), (["tiny", "--programs", "ceres"], "no program 'ceres'")],
)
def test_unknown_names_are_refused(app, options, message):
    refused = CliRunner().invoke(app, options)
    assert refused.exit_code == 2
    assert message in in_one_line(refused)
