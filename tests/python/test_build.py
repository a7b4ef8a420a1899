"""The plain CMake build: without Python, with the tests, and of the version that pip sees."""

import importlib.metadata
import os
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


@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
@pytest.mark.parametrize(
    ("define", "environment", "message"),
    [
        ("CMAKE_DISABLE_FIND_PACKAGE_Ceres=ON", {}, "Ceres 2.1 or newer was not found."),
        ("CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON", {}, "Eigen3 3.4 or newer was not found."),
        ("Ceres_DIR={old}", {}, "Ceres 2.1 or newer is needed, but this is 1.14.0."),
        ("UNUSED=", {"CXX": "/nonexistent/c++"}, "No C++ compiler was found."),
    ],
)
def test_what_is_missing_is_named_with_the_line_that_installs_it(
    tmp_path: Path, define: str, environment: dict[str, str], message: str
) -> None:
    old = tmp_path / "old"
    old.mkdir()
    (old / "CeresConfig.cmake").write_text("set(Ceres_FOUND TRUE)\nset(Ceres_VERSION 1.14.0)\n")
    command = ["cmake", "-G", "Ninja", "-S", ROOT, "-B", tmp_path / "tree"]
    result = subprocess.run(
        [*command, f"-D{define.format(old=old)}"],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1
    lines = [line.strip() for line in result.stderr.splitlines()]
    start = lines.index(message)
    assert lines[start + 2 : start + 7] == [
        "Debian, Ubuntu   sudo apt-get install g++ python3-dev libceres-dev",
        "Fedora           sudo dnf install gcc-c++ python3-devel ceres-solver-devel",
        "Arch             sudo pacman -S --needed base-devel ceres-solver",
        "macOS            xcode-select --install; brew install ceres-solver",
        "conda            conda install -c conda-forge cxx-compiler eigen ceres-solver",
    ]
