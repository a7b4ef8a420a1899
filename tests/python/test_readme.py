"""What the README shows is executed; CONTRIBUTING.md states the rule."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from pages import ROOT, blocks, commands, execute

README = ROOT / "README.md"


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make the directory that all blocks share, in the README's order, with its data/ inside."""
    path = tmp_path_factory.mktemp("readme")
    (path / "data").symlink_to(ROOT / "data")
    return path


@pytest.mark.parametrize("code", [block.text for block in blocks(README, "python")])
def test_python_block(code: str, directory: Path) -> None:
    execute([sys.executable, "-c", code], directory)


@pytest.mark.parametrize("command", commands(README, "bash", "dqslam "))
def test_command(command: str, directory: Path) -> None:
    execute(["bash", "-c", f"dqslam {command}"], directory)


@pytest.mark.parametrize("command", commands(README, "bash", "./run "))
def test_job_exists(command: str) -> None:
    usage = subprocess.run([ROOT / "run", "help"], capture_output=True, text=True, check=True)
    jobs = re.findall(r"^  (\w+) ", usage.stdout, flags=re.MULTILINE)
    assert command.split()[0] in jobs
