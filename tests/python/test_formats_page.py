"""What docs/formats.md shows is run, and it names every format."""

import re
from pathlib import Path

import numpy as np

from dqslam import io
from dqslam.cli import main

PAGE = (Path(__file__).resolve().parents[2] / "docs/formats.md").read_text(encoding="utf-8")


def block(language):
    (text,) = re.findall(rf"^```{language}\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    return text


def test_the_example(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shell = block("bash")
    (name, text) = re.search(r"cat > (\S+) <<END\n(.*?)END\n", shell, flags=re.DOTALL).groups()
    Path(name).write_text(text)
    commands = [line.split() for line in shell.splitlines() if line.startswith("dqslam ")]
    assert len(commands) == 2
    for command in commands:
        assert main(command[1:]) == 0
    assert Path("boxes.csv").read_text() == block("text")
    names: dict[str, object] = {}
    exec(block("python"), names)
    np.testing.assert_array_equal(names["boxes"].box, [[10, 20, 40, 60], [12, 20, 42, 60]])


def test_every_format_has_a_row():
    formats = (*io.CAMERA_FORMATS, *io.TRAJECTORY_FORMATS, *io.DETECTION_FORMATS)
    rows = [line for line in PAGE.splitlines() if line.startswith("| `")]
    named = {name for row in rows for name in re.findall(r"`(\w[\w-]*)`", row.split("|")[1])}
    assert named == {format_.name for format_ in formats}
