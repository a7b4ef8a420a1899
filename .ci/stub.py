"""Write the type stub of the C++ extension: python .ci/stub.py OUTPUT."""

import enum
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dqslam import _core


def generate(directory: Path) -> Path:
    """Run the generator on the installed extension, any unknown C++ type being an error."""
    options = ["--exit-code", "--output-dir", directory]
    options += ["--enum-class-locations", ".+:dqslam._core"]
    generator = [sys.executable, "-m", "pybind11_stubgen", "dqslam._core"]
    subprocess.run([*generator, *options], check=True)
    return directory / "dqslam" / "_core.pyi"


def for_type_checkers(text: str) -> str:
    """Turn `SE2: ClassVar[PoseModel]` into the member `SE2 = 0`; annotate keyword arguments."""
    for name, value in vars(_core).items():
        if not (isinstance(value, type) and issubclass(value, enum.Enum)):
            continue
        for member in value:
            declaration = rf"\b{member.name}: typing\.ClassVar\[{name}\].*"
            text = re.sub(declaration, f"{member.name} = {member.value!r}", text)
    text = text.replace("**kwargs)", "**kwargs: typing.Any)")
    return re.sub(r" +@classmethod\n +def __new__\(cls, value\):\s+\.\.\.\n", "", text)


def tidy(stub: Path) -> None:
    """Sort the imports and format, whatever the project's own settings say about the file."""
    ruff = [sys.executable, "-m", "ruff", "--quiet"]
    options = ["--isolated", "--line-length", "100", "--target-version", "py311"]
    select = ["--select", "I,UP,F401", "--fix", "--exit-zero"]
    subprocess.run([*ruff, "check", *options, *select, stub], check=True)
    subprocess.run([*ruff, "format", *options, stub], check=True)


def write_stub(output: Path) -> None:
    """Generate the stub at `output`."""
    with tempfile.TemporaryDirectory() as directory:
        stub = generate(Path(directory))
        stub.write_text(for_type_checkers(stub.read_text()))
        tidy(stub)
        shutil.copyfile(stub, output)


if __name__ == "__main__":
    write_stub(Path(sys.argv[1]))
