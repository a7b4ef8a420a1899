"""``python -m benchmarks.places``: one entry for all cases of maps of one place."""

import re

import pytest
from benchmarks.places.__main__ import app
from typer.testing import CliRunner

CASES = (
    "robots",
    "real",
    "rooms",
    "worlds",
    "walks",
    "recording",
    "large",
    "changes",
    "halves",
)


def test_help_names_each_case():
    text = CliRunner().invoke(app, ["--help"]).output
    assert [name for name in CASES if not re.search(rf"│ {name} ", text)] == []


@pytest.mark.parametrize("case", CASES)
def test_each_case_has_a_help_of_its_own(case):
    result = CliRunner().invoke(app, [case, "--help"])
    assert result.exit_code == 0
    assert f" {case} " in result.output


def test_an_unknown_case_exits_with_2():
    result = CliRunner().invoke(app, ["robot"])
    assert result.exit_code == 2
    assert "No such command 'robot'" in result.output


def test_a_map_of_some_objects_locates_its_images():
    given = ["large", "--count", "40", "--classes", "8", "--images", "4", "--seed", "1"]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, result.output
    assert "40 objects of 8 classes" in result.output
    assert re.search(r"\d images, CPU 0\.\d{4} s each", result.output)
