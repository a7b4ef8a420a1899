"""Code blocks of Markdown pages, and how they are executed."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs/api").glob("*.md"))]


class Block(NamedTuple):
    """A fenced block: its language and its text."""

    language: str
    text: str


def blocks(page: Path, *languages: str) -> list[Block]:
    """Give the blocks of a page in these languages, in order."""
    fence = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
    found = [Block(*match.groups()) for match in fence.finditer(page.read_text(encoding="utf-8"))]
    return [block for block in found if block.language in languages]


def commands(page: Path, language: str, prompt: str = "") -> list[str]:
    """Give the lines of a language's blocks that start with a prompt, without it, continued."""
    text = "".join(block.text for block in blocks(page, language))
    lines = text.replace("\\\n", " ").splitlines()
    return [line.removeprefix(prompt) for line in lines if line.startswith(prompt)]


def execute(arguments: list[str], directory: Path) -> None:
    """Run a program in a directory, where `dqslam` is the one beside this Python."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        arguments,
        cwd=directory,
        env=os.environ | {"MPLBACKEND": "Agg", "PATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def execute_block(block: Block, directory: Path) -> None:
    """Run a block of bash or Python as a whole."""
    if block.language == "python":
        execute([sys.executable, "-c", block.text], directory)
    else:
        execute(["bash", "-euo", "pipefail", "-c", block.text], directory)
