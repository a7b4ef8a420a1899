"""The public names: found when asked for, known to type checkers, and in nobody's way."""

import ast
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import dqslam

SOURCE = Path(dqslam.__file__)


def test_type_checkers_see_the_same_names():
    tree = ast.parse(SOURCE.read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == dqslam._HOMES


@pytest.mark.parametrize("name", dqslam.__all__)
def test_every_public_name_is_there(name):
    assert not isinstance(getattr(dqslam, name), ModuleType)
    assert name in dir(dqslam)


def test_an_unknown_name():
    with pytest.raises(AttributeError, match="module 'dqslam' has no attribute 'simulat'"):
        dqslam.simulat  # noqa: B018


def test_the_package_alone_imports_nothing_heavy():
    code = "import sys, dqslam; print(*{name.partition('.')[0] for name in sys.modules})"
    path = str(SOURCE.parents[1])
    result = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {path!r}); {code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not {"numpy", "scipy", "pydantic", "typer"} & set(result.stdout.split())
