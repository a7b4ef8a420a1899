"""What all commands share: the table of contents, help, exit codes, completion, the page."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import pytest
import typer.main

import dqslam
from dqslam.cli import COMMANDS, EXIT_CODES, app, main

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "command_line.md"
CODE = "import sys; from dqslam.cli import main; sys.exit(main(sys.argv[1:]))"
HEAVY = {"numpy", "scipy", "pydantic", "matplotlib", "joblib", "viser", "rerun", "dask"}
COMMAND_NAMES = [command.__name__ for panel in COMMANDS.values() for command in panel]
GROUP = typer.main.get_command(app)
PARAMETERS = [
    pytest.param(name, parameter, id=f"{name}-{parameter.name}")
    for name in COMMAND_NAMES
    for parameter in GROUP.commands[name].params
]
# What a number counts or measures.
UNITS = (
    r"\bm\b|\brad\b|\bpx\b|meters|seconds|pixels|degrees|share|probability|seed|score|processes"
    r"|drives|objects|trials|frames|images|threads|bytes|boxes|port|width|height|times|\bHz\b|dots"
)


def call(*arguments, **environment):
    """Run the command in a process of its own, where nothing is imported yet."""
    path = os.pathsep.join(
        [str(Path(dqslam.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    )
    return subprocess.run(
        [sys.executable, "-c", CODE, *arguments],
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "100"} | environment,
        capture_output=True,
        text=True,
    )


def test_the_help_is_a_table_of_contents_that_waits_for_nothing_heavy():
    code = (
        "import sys; from dqslam.cli import main; code = main(['--help']);"
        "print(*{name.partition('.')[0] for name in sys.modules}, file=sys.stderr); sys.exit(code)"
    )
    path = str(Path(dqslam.__file__).parents[1])
    result = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {path!r}); {code}"],
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    assert not HEAVY & set(result.stderr.split())
    for panel in COMMANDS:
        assert panel in result.stdout
    for name in COMMAND_NAMES:
        assert re.search(rf"^. {name} ", result.stdout, flags=re.MULTILINE)
    text = " ".join(result.stdout.split())
    for code_number in EXIT_CODES:
        assert f"{code_number}: " in text


def is_number(name, parameter):
    function = next(one for panel in COMMANDS.values() for one in panel if one.__name__ == name)
    hint = get_type_hints(function)[parameter.name]
    return {int, float} & {hint, *get_args(hint)}


@pytest.mark.parametrize(("name", "parameter"), PARAMETERS)
def test_every_option_says_what_it_is_and_in_which_unit(name, parameter):
    assert parameter.help
    if is_number(name, parameter):
        assert re.search(UNITS, parameter.help, flags=re.IGNORECASE), parameter.help
        if not parameter.required and parameter.default is None:
            assert re.search("default", parameter.help, flags=re.IGNORECASE), parameter.help


@pytest.mark.parametrize("name", COMMAND_NAMES)
def test_the_help_of_every_command_has_its_options_and_defaults(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")  # narrower, long names are cut
    assert main([name, "--help"]) == 0
    shown = capsys.readouterr().out
    for parameter in GROUP.commands[name].params:
        if getattr(parameter, "hidden", False):
            continue
        if parameter.opts[0].startswith("--"):
            assert parameter.opts[0] in shown
        if is_number(name, parameter) and parameter.default is not None:
            assert f"[default: {parameter.default}]" in " ".join(shown.replace("│", "").split())
    assert GROUP.commands[name].help.splitlines()[0] in " ".join(shown.split())


@pytest.mark.parametrize("name", COMMAND_NAMES)
def test_every_command_can_be_quiet(name):
    assert "--quiet" in [option for one in GROUP.commands[name].params for option in one.opts]


def test_the_page_lists_each_command_and_each_exit_code():
    page = PAGE.read_text(encoding="utf-8")
    listed = re.findall(r"^\| `dqslam (\w+)` \|", page, flags=re.MULTILINE)
    assert listed == COMMAND_NAMES
    codes = dict(re.findall(r"^\| (\d+) \| (.+) \|$", page, flags=re.MULTILINE))
    assert codes == {str(number): why for number, why in EXIT_CODES.items()}


@pytest.mark.parametrize(
    ("shell", "words"), [("bash", "dqslam si"), ("zsh", "dqslam si"), ("fish", "dqslam si")]
)
def test_completion(shell, words):
    script = call(_DQSLAM_COMPLETE=f"source_{shell}")
    assert "_DQSLAM_COMPLETE" in script.stdout
    variables = {
        "_DQSLAM_COMPLETE": f"complete_{shell}",
        "_TYPER_COMPLETE_ARGS": words,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        "COMP_WORDS": words,
        "COMP_CWORD": "1",
    }
    assert "simulate" in call(**variables).stdout


def test_no_command_is_the_help(capsys):
    assert main([]) == 2
    shown = capsys.readouterr()
    assert "Start here" in shown.out
    assert shown.err == ""


def test_an_unknown_command_is_one_line(capsys):
    assert main(["simulat"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "No such command 'simulat'" in line


def test_the_version(capsys):
    assert main(["--version"]) == 0
    shown = capsys.readouterr().out
    assert re.fullmatch(r"dqslam (\d+\.\d+\.\d+|\(not installed\))\n", shown)
