"""Lint finds includes of the C++ core that go the wrong way, and files that are too long."""

import importlib.util
import subprocess
from pathlib import Path

import pytest

CI = Path(__file__).resolve().parents[2] / ".ci"
spec = importlib.util.spec_from_file_location("check_layers", CI / "check_layers.py")
check_layers = importlib.util.module_from_spec(spec)
spec.loader.exec_module(check_layers)

PUBLIC = ["dqslam.h", "geometry/pose.h", "geometry/manifolds.h", "costs/box.h", "problem/graph.h"]
TREE = {
    "dqslam.h": ["dqslam/geometry/pose.h", "dqslam/problem/graph.h"],
    "geometry/pose.h": ["Eigen/Core"],
    "geometry/jets.h": ["ceres/jet.h", "dqslam/geometry/pose.h"],
    "geometry/manifolds.h": ["ceres/manifold.h", "dqslam/geometry/pose.h"],
    "costs/box.h": ["ceres/autodiff_cost_function.h", "dqslam/geometry/pose.h"],
    "problem/graph.h": ["dqslam/geometry/pose.h"],
    "problem/graph.cc": ["dqslam/problem/graph.h", "ceres/problem.h", "dqslam/geometry/jets.h"],
    "solver/stage.h": ["ceres/loss_function.h", "dqslam/problem/graph.h"],
    "solver/loss.h": ["dqslam/solver/stage.h"],
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "CMakeLists.txt").write_text("\n".join(f"cpp/dqslam/{file}" for file in PUBLIC))
    for file, targets in TREE.items():
        path = tmp_path / "cpp/dqslam" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("#pragma once\n" + "".join(f'#include "{name}"\n' for name in targets))
    return tmp_path


def plant(root: Path, file: str, target: str) -> None:
    path = root / "cpp/dqslam" / file
    path.parent.mkdir(exist_ok=True)
    with path.open("a") as opened:
        opened.write(f'#include "{target}"\n')


def test_includes_that_go_down_or_stay_are_right(root: Path) -> None:
    assert check_layers.faults(root) == []


@pytest.mark.parametrize(
    ("file", "line", "target", "complaint"),
    [
        ("problem/graph.cc", 5, "dqslam/solver/stage.h", "solver is above problem: geometry <"),
        ("solver/loss.h", 3, "dqslam/dqslam.h", "dqslam.h is above solver: geometry <"),
        ("problem/prepared.h", 1, "ceres/problem.h", "Ceres belongs into costs, body.h"),
        ("geometry/pose.h", 3, "glog/logging.h", "Ceres belongs into costs, body.h"),
        (
            "geometry/manifolds.h",
            4,
            "dqslam/geometry/jets.h",
            "this header is public and installed",
        ),
        ("problem/graph.h", 3, "dqslam/costs/box.h", "only dqslam::costs needs Ceres"),
    ],
)
def test_a_planted_include_is_found(
    root: Path, file: str, line: int, target: str, complaint: str
) -> None:
    plant(root, file, target)
    (found,) = check_layers.faults(root)
    assert found.startswith(f"cpp/dqslam/{file}:{line}: includes {target}, but {complaint}")


def test_a_planted_circle_is_found(root: Path) -> None:
    plant(root, "solver/stage.h", "dqslam/solver/loss.h")
    (found,) = check_layers.faults(root)
    assert found == (
        "cpp/dqslam/solver/stage.h:4: a circle: "
        "dqslam/solver/stage.h -> dqslam/solver/loss.h -> dqslam/solver/stage.h"
    )


def test_a_file_outside_the_rooms_is_found(root: Path) -> None:
    plant(root, "planning/route.h", "vector")
    (found,) = check_layers.faults(root)
    assert found.startswith("cpp/dqslam/planning/route.h: is in none of the rooms geometry, costs")


def test_a_public_header_belongs_into_the_umbrella(root: Path) -> None:
    with (root / "CMakeLists.txt").open("a") as opened:
        opened.write("\ncpp/dqslam/solver/loss.h")
    assert check_layers.faults(root) == [
        "cpp/dqslam/solver/loss.h:2: includes dqslam/solver/stage.h, but this header is public and "
        "installed, the included one is not",
        "cpp/dqslam/dqslam.h: does not include dqslam/solver/loss.h, which is public",
    ]


@pytest.mark.parametrize(("lines", "fits"), [(350, True), (351, False)])
def test_no_file_is_longer_than_350_lines(root: Path, lines: int, fits: bool) -> None:
    package = root / "python/dqslam"
    package.mkdir(parents=True)
    (package / "_core.pyi").write_text("\n" * 1000)  # is generated
    (package / "graph.py").write_text("\n" * lines)
    (root / "cpp/dqslam/problem/graph.cc").write_text("\n" * (lines - 1))
    result = subprocess.run([CI / "check_sizes", root], capture_output=True, text=True, check=False)
    assert result.returncode == (0 if fits else 1)
    expected = "python/dqslam/graph.py: has 351 lines, 350 are allowed\n"
    assert result.stdout == ("" if fits else expected)
