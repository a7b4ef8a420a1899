"""What the README shows is executed; CONTRIBUTING.md states the rule."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def commands(program: str) -> list[str]:
    """Give the lines of the bash blocks that start with `program`, continuations joined."""
    lines = "\n".join(blocks("bash")).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.split()[:1] == [program]]


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make the directory that all blocks share, in the README's order, with its data/ inside."""
    path = tmp_path_factory.mktemp("readme")
    (path / "data").symlink_to(ROOT / "data")
    return path


def execute(arguments: list[str], directory: Path) -> None:
    scripts = Path(sys.executable).parent
    path = f"{scripts}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"MPLBACKEND": "Agg", "PATH": path}
    result = subprocess.run(
        arguments,
        cwd=directory,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("code", blocks("python"))
def test_python_block(code: str, directory: Path) -> None:
    execute([sys.executable, "-c", code], directory)


@pytest.mark.parametrize("command", commands("dqslam"))
def test_command(command: str, directory: Path) -> None:
    execute(["bash", "-c", command], directory)


@pytest.mark.parametrize("command", commands("./run"))
def test_job_exists(command: str) -> None:
    usage = subprocess.run([ROOT / "run", "help"], capture_output=True, text=True, check=True)
    jobs = re.findall(r"^  (\w+) ", usage.stdout, flags=re.MULTILINE)
    assert command.split()[1] in jobs
