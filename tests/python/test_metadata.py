"""What catalogs read: the package's metadata and CITATION.cff agree with each other."""

import datetime
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install 'dqslam[yaml]'")
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version() -> None:
    cmake = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    (version,) = re.findall(r"project\(\s*dqslam\s+VERSION\s+([\d.]+)", cmake)
    assert CITATION["version"] == version
    assert isinstance(CITATION["date-released"], datetime.date)
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["authors"] == [{"name": PROJECT["authors"][0]["name"]}]
    page = (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert f"version = {{{version}}}" in page
    assert f"year    = {{{CITATION['date-released'].year}}}" in page
    assert CITATION["preferred-citation"]["url"] == PROJECT["urls"]["Paper"]


def test_classifiers() -> None:
    """Those of Python start at the oldest version that is allowed; words are sorted."""
    classifiers = PROJECT["classifiers"]
    assert classifiers == sorted(classifiers, key=lambda name: name.split(" :: "))
    versions = [int(one) for one in re.findall(r"Python :: 3\.(\d+)", "\n".join(classifiers))]
    assert PROJECT["requires-python"] == f">=3.{min(versions)}"
    assert versions == list(range(min(versions), max(versions) + 1))
    assert not [name for name in classifiers if name.startswith("License ::")]  # PEP 639
    assert PROJECT["keywords"] == sorted(PROJECT["keywords"], key=str.lower)


def test_classifiers_exist() -> None:
    known = pytest.importorskip("trove_classifiers", reason="trove-classifiers is not installed")
    assert set(PROJECT["classifiers"]) <= known.classifiers
