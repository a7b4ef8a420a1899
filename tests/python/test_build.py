"""The plain CMake build, of the version that pip sees, and the library that it installs."""

import importlib.metadata
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
TREE = Path(os.environ.get("DQSLAM_TREE", ROOT / "build/run"))  # what ./run has built

# Who solves with Ceres himself: the manifolds are part of the library, the costs are templates.
PROJECT = """
cmake_minimum_required(VERSION 3.24)
project(costs LANGUAGES CXX)
find_package(dqslam 0.1 REQUIRED)
add_executable(main main.cc)
target_link_libraries(main PRIVATE dqslam::costs)
"""
MAIN = """
#include <dqslam/geometry/manifolds.h>
#include <iostream>
int main() {
  const dqslam::EllipsoidManifold ellipsoid;
  const dqslam::PoseManifold<dqslam::Se3> pose;
  std::cout << ellipsoid.TangentSize() << ' ' << pose.AmbientSize() << ' ' << pose.TangentSize();
}
"""


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


def call(*command: object) -> str:
    result = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def files_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def build_against(prefix: Path, project: Path, tree: Path) -> None:
    call("cmake", "-S", project, "-B", tree, f"-DCMAKE_PREFIX_PATH={prefix}")
    call("cmake", "--build", tree)


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not (TREE / "libdqslam.a").is_file():
        pytest.skip(f"{TREE} has no library: ./run test builds it, DQSLAM_TREE names another tree")
    prefix = tmp_path_factory.mktemp("prefix")
    call("cmake", "--install", TREE, "--prefix", prefix, "--component", "library")
    return prefix


def test_public_headers_are_installed_and_no_others(prefix: Path) -> None:
    listed = re.findall(r"cpp/(dqslam/\S+\.h)\b", (ROOT / "CMakeLists.txt").read_text())
    assert files_in(prefix / "include") == set(listed)
    others = {path.rpartition("/")[2] for path in files_in(prefix) if not path.endswith(".h")}
    package = {"dqslamConfig.cmake", "dqslamConfigVersion.cmake", "dqslamTargets.cmake"}
    assert others - {"dqslamTargets-release.cmake"} == {"libdqslam.a", *package}


def test_a_wheel_has_the_extension_and_data_alone(prefix: Path, tmp_path: Path) -> None:
    if not list(TREE.glob("_core*.so")):
        pytest.skip(f"{TREE} has no extension")
    call("cmake", "--install", TREE, "--prefix", tmp_path, "--component", "python")
    suffixes = {path.suffix for path in map(Path, files_in(tmp_path))}
    assert suffixes == {".so", ".toml"}
    assert files_in(tmp_path / "dqslam/data/scenarios") == files_in(ROOT / "data/scenarios")


def test_a_strangers_project_finds_the_library(prefix: Path, tmp_path: Path) -> None:
    build_against(prefix, ROOT / "examples/cpp", tmp_path)
    printed = call(tmp_path / "locate_object")
    lines = [line.split() for line in printed.splitlines()]
    assert printed.startswith("center, m:\n")
    assert [float(word) for word in lines[1]] == pytest.approx([0.3, 5.2, 0.6], abs=2e-3)
    covariance = np.array(lines[3:6], dtype=float)
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > 0
    # Twelve pairs of edges of 1 px each, seen from 5 m with 400 px of focal length.
    assert covariance[2, 2] == pytest.approx((5 / 400) ** 2 / 24, rel=0.1)


def test_costs_are_a_target_of_their_own(prefix: Path, tmp_path: Path) -> None:
    """Of what an installed header of them needs, nothing is missing."""
    headers = sorted((prefix / "include").glob("dqslam/costs/*.h"))
    assert "box.h" in {path.name for path in headers}
    includes = [f"#include <dqslam/costs/{path.name}>" for path in headers]
    (tmp_path / "main.cc").write_text("\n".join([*includes, MAIN]))
    (tmp_path / "CMakeLists.txt").write_text(PROJECT)
    build_against(prefix, tmp_path, tmp_path / "tree")
    assert call(tmp_path / "tree/main") == "9 7 6"
