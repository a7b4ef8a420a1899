"""Tables, lines, one document or nothing; no bars where nobody looks."""

import json

import numpy as np
import pytest

from dqslam.cli.output import Output


def say_all(output, tmp_path):
    (tmp_path / "x.json").write_text('{"a": 1}\n')
    output.table("a table")
    output.line("a line [bold] of 1 word")
    output.document({"nan": float("nan"), "list": np.arange(2)})
    with output.trials(3) as progress:
        progress(1, 3)
    with output.share("working") as share:
        share(0.5)
    with output.steps("reading", 2) as done:
        done()
    with output.waiting("waiting"):
        pass


def test_people_see_tables_and_lines(tmp_path, capsys):
    say_all(Output(), tmp_path)
    shown = capsys.readouterr()
    assert shown.out == "a table\na line [bold] of 1 word\n"
    assert shown.err == ""


def test_quiet_is_quiet(tmp_path, capsys):
    say_all(Output(quiet=True), tmp_path)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("quiet", [False, True])
def test_machines_get_one_document(tmp_path, capsys, quiet):
    say_all(Output(quiet=quiet, as_json=True), tmp_path)
    shown = capsys.readouterr()
    assert json.loads(shown.out) == {"nan": None, "list": [0, 1]}
    assert shown.err == ""


def test_a_file_is_named_or_printed(tmp_path, capsys):
    path = tmp_path / "x.json"
    path.write_text('{"a": 1}\n')
    Output().file(path)
    assert capsys.readouterr().out == f"wrote {path}\n"
    Output(as_json=True).file(path)
    assert capsys.readouterr().out == '{"a": 1}\n'
    Output(quiet=True).file(path)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("quiet", [False, True])
def test_a_bar_is_for_terminals(capsys, monkeypatch, quiet):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with Output(quiet=quiet).trials(4) as progress:
        progress(3, 4)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("3/4" in shown.err) != quiet


def test_the_time_left_is_shown_once_a_share_is_told(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("COLUMNS", "120")
    with Output().share("reading"):
        pass
    untold = capsys.readouterr().err
    assert "reading" in untold
    assert "0:00:00" in untold  # since when
    assert "%" not in untold
    assert "left" not in untold
    with Output().steps("reading", 4) as done:
        done()
    told = capsys.readouterr().err
    assert "25%" in told
    assert "left" in told
