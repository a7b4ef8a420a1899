"""docs/installation.md says what pyproject.toml and cmake/Requirements.cmake say."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def names(requirements: list[str]) -> list[str]:
    return [re.match(r"[\w.-]+", requirement)[0] for requirement in requirements]


def test_core_needs_five_packages_and_the_page_names_them() -> None:
    needed = names(PROJECT["dependencies"])
    assert needed == ["numpy", "scipy", "pydantic", "typer", "rich"]
    assert "needs numpy, scipy, pydantic, typer and rich." in PAGE


def test_every_extra_is_on_the_page() -> None:
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ", PAGE, flags=re.MULTILINE)
    listed = re.findall(r"`(\w+)`", " ".join(rows))
    assert sorted(listed) == sorted(PROJECT["optional-dependencies"])


def test_extras_of_one_purpose_are_listed_with_their_packages() -> None:
    for extra in ("plot", "view", "rerun", "cluster", "rosbag", "yaml", "evo"):
        packages = ", ".join(names(PROJECT["optional-dependencies"][extra]))
        assert re.search(rf"^\| `{extra}` \| {packages}( \(GPL\))? \|", PAGE, flags=re.MULTILINE)


def test_the_build_names_the_same_packages() -> None:
    said = (ROOT / "cmake" / "Requirements.cmake").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [^|`]+ \| `([^`]+)` \|$", PAGE, flags=re.MULTILINE)
    assert len(rows) == 5
    assert rows == re.findall(r"^  \w+(?:, \w+)?  +(\S.*)$", said, flags=re.MULTILINE)
