"""The help of all commands: complete in a narrow terminal, and one meaning for each option."""

import inspect
import os
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
import typer

import dqslam
from dqslam._version import version
from dqslam.cli import app, main

COMMANDS = typer.main.get_command(app).commands
SOURCE = str(Path(dqslam.__file__).parents[1])


def run_module(*arguments, columns="80"):
    return subprocess.run(
        [sys.executable, "-m", "dqslam", *arguments],
        env=os.environ | {"PYTHONPATH": SOURCE, "COLUMNS": columns},
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_cut_at_80_columns(name):
    shown = run_module(name, "-h")
    assert shown.returncode == 0, shown.stderr
    assert "…" not in shown.stdout
    assert max(map(len, shown.stdout.splitlines())) <= 80
    for parameter in COMMANDS[name].params:
        if getattr(parameter, "hidden", False):  # an earlier name
            continue
        for option in (*parameter.opts, *parameter.secondary_opts):
            if option.startswith("-"):
                assert option in shown.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_all_of_a_help_is_shown(name, capsys, monkeypatch):
    """Nothing is taken for markup, and a sentence goes on over the lines of its docstring."""
    monkeypatch.setenv("COLUMNS", "500")
    assert main([name, "-h"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for paragraph in COMMANDS[name].help.split("\n\n"):
        assert " ".join(paragraph.split()) in shown
    for parameter in COMMANDS[name].params:
        if not getattr(parameter, "hidden", False):
            assert parameter.help in shown
    assert "<" not in shown.replace("<=", "")  # no types of Python


def test_a_switch_has_no_value():
    words = {"-q": "", "--out": "DIR", "--jobs": "N", "--groundtruth": "PATH", "--ids": "SOURCE"}
    context = typer.Context(COMMANDS["run"])
    found = {one.opts[-1]: one.metavar for one in COMMANDS["run"].get_params(context)}
    found |= {one.opts[0]: one.metavar for one in COMMANDS["run"].params}
    found |= {one.opts[0]: one.metavar for one in COMMANDS["batch"].get_params(context)}
    assert {name: found[name] for name in words} == words
    assert found["--mode"] == "slam|mapping"
    assert found["--backend"] == "serial | processes | loky | dask | ray"


def test_the_module_is_the_program():
    assert run_module("--version").stdout == f"dqslam {version()}\n"
    assert run_module("nothing").returncode == 2
    assert run_module("-h").stdout == run_module("--help").stdout


def test_an_option_is_of_one_type_in_all_commands():
    """The choices, or else the type, of an option are the same wherever help shows it."""
    kinds = defaultdict(lambda: defaultdict(list))
    for name, command in COMMANDS.items():
        hints = get_type_hints(inspect.unwrap(command.callback))
        for parameter in command.params:
            if getattr(parameter, "hidden", False):  # earlier names, which still work
                continue
            hint = hints.get(parameter.name)
            kind = frozenset(get_args(hint)) - {type(None)} or frozenset({hint})
            if kind == {list[str]}:  # one that may be repeated
                kind = frozenset({str})
            for option in parameter.opts:
                kinds[option][kind].append(name)
    assert len(kinds["--groundtruth"][frozenset({Path})]) == 4
    assert {one: dict(found) for one, found in kinds.items() if len(found) > 1} == {}


def test_what_is_written_is_said_by_o():
    for name, command in COMMANDS.items():
        for parameter in command.params:
            if "--out" in parameter.opts:
                assert "-o" in parameter.opts, name
