"""The plain CMake build: without Python, with the tests, and of the version that pip sees."""

import importlib.metadata
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
def test_plain_configuration(tmp_path: Path) -> None:
    command = ["cmake", "-G", "Ninja", "-S", ROOT, "-B", tmp_path]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    lines = (tmp_path / "CMakeCache.txt").read_text().splitlines()
    cache = {key.split(":")[0]: value for key, _, value in (line.partition("=") for line in lines)}
    assert cache["CMAKE_PROJECT_VERSION"] == importlib.metadata.version("dqslam")
    assert cache["CMAKE_BUILD_TYPE"] == "Release"
    assert cache["DQSLAM_BUILD_PYTHON"] == "OFF"
    assert cache["DQSLAM_BUILD_TESTS"] == "ON"
    assert not [key for key in cache if key.lower().startswith(("python", "pybind11"))]
