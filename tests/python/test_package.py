"""The public names: found when asked for, known to type checkers, and in nobody's way."""

import ast
import enum
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import dqslam
from dqslam import _core, studies

SOURCE = Path(dqslam.__file__)


def names_for_type_checkers(package):
    """Give the names that a package imports for type checkers, however the lines are broken."""
    tree = ast.parse(Path(package.__file__).read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    return sorted(alias.asname for node in block.body for alias in node.names)


@pytest.mark.parametrize("package", [dqslam, studies])
def test_what_type_checkers_see_is_what_there_is(package):
    assert dir(package) == names_for_type_checkers(package)


@pytest.mark.parametrize("name", dir(dqslam))
def test_every_public_name_is_there(name):
    value = getattr(dqslam, name)
    assert isinstance(value, ModuleType) == (name not in dqslam.__all__)
    assert getattr(dqslam, name) is value


def test_every_choice_of_the_core_is_public():
    choices = [
        name
        for name, value in vars(_core).items()
        if isinstance(value, type) and issubclass(value, enum.Enum)
    ]
    assert len(choices) == 12
    for name in (*choices, "State"):
        assert getattr(dqslam, name) is getattr(_core, name)


def test_the_version_is_the_latest_of_the_changelog():
    changes = SOURCE.parents[2] / "CHANGELOG.md"
    if not changes.is_file():
        pytest.skip("the package is installed without its project")
    latest = re.search(r"^## \[([^]]+)\]", changes.read_text(), re.MULTILINE)
    assert dqslam.__version__ == latest[1]


def test_an_unknown_name():
    with pytest.raises(AttributeError, match="module 'dqslam' has no attribute 'simulat'"):
        dqslam.simulat  # noqa: B018


def fresh(code):
    """Run code in a new interpreter that has this package, and return what it prints."""
    path = str(SOURCE.parents[1])
    result = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {path!r}); {code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    return result.stdout.split()


def test_the_package_alone_imports_nothing_heavy():
    found = fresh("import sys, dqslam; print(*{name.partition('.')[0] for name in sys.modules})")
    assert "dqslam" in found
    assert not {"numpy", "scipy", "pydantic", "typer"} & set(found)


def test_subpackages_need_no_import_of_their_own():
    code = "import dqslam as dq; print(dq.io.__name__, dq.studies.sweep.__name__)"
    assert fresh(code) == ["dqslam.io", "dqslam.studies.sweep"]


def test_a_star_hides_no_module():
    assert fresh("import io; from dqslam import *; print(io.__name__, Mode.SLAM)") == [
        "io",
        "Mode.SLAM",
    ]
