"""The checks of a binary wheel refuse what they should; the wheel itself is made by ./run wheel."""

import importlib.util
import re
import sys
import zipfile
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from dqslam import _core

ROOT = Path(__file__).resolve().parents[2]
CORE = Path(_core.__file__)
LICENSES = ("LICENSE", "ceres-solver.txt", "eigen.txt", "pybind11.txt", "sources.txt")


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / ".ci" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


solve_seeds = load("solve_seeds")


def write_wheel(
    path: Path, core: bytes | None = None, licenses: tuple[str, ...] = LICENSES, more: str = ""
) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        if core is not None:
            archive.writestr(f"dqslam/{CORE.name}", core)
        for name in licenses:
            archive.writestr(f"dqslam-0.1.0.dist-info/licenses/{name}", "text")
        if more:
            archive.writestr(more, b"")
    return path


@pytest.fixture
def check_wheel() -> ModuleType:
    pytest.importorskip("elftools", reason="pyelftools is not installed")
    return load("check_wheel")


@pytest.mark.skipif(sys.platform != "linux", reason="reads ELF files")
def test_a_core_that_needs_more_than_the_system_is_refused(
    tmp_path: Path, check_wheel: ModuleType
) -> None:
    needed = check_wheel.needed_libraries(CORE.read_bytes())
    assert {"libm.so.6", "libstdc++.so.6"} <= needed
    check_wheel.SYSTEM = needed - {"libm.so.6", "libstdc++.so.6"}
    wheel = write_wheel(tmp_path / "dqslam-manylinux.whl", CORE.read_bytes())
    assert f"{CORE.name} needs libm.so.6, libstdc++.so.6" in check_wheel.faults(wheel)
    with pytest.raises(SystemExit, match=r"dqslam-manylinux\.whl: _core.* needs libm"):
        check_wheel.main(wheel)


def test_size_name_licenses_and_binaries_are_checked(
    tmp_path: Path, check_wheel: ModuleType
) -> None:
    path = tmp_path / "dqslam-linux.whl"
    write_wheel(
        path, licenses=("LICENSE", "eigen.txt", "sources.txt"), more="dqslam.libs/libgomp.so.1"
    )
    check_wheel.needed_libraries = lambda elf: {"libm.so.6"}
    size = path.stat().st_size
    check_wheel.MAX_BYTES = size
    assert check_wheel.faults(path) == [
        f"it has {size} bytes, {size} are allowed",
        "its name promises no manylinux platform",
        "the license ceres-solver.txt is missing",
        "the license pybind11.txt is missing",
        "its binaries are dqslam.libs/libgomp.so.1, not _core alone",
    ]


def test_cholmod_inside_is_refused(tmp_path: Path, check_wheel: ModuleType) -> None:
    check_wheel.needed_libraries = lambda elf: {"libm.so.6"}
    wheel = write_wheel(tmp_path / "dqslam-manylinux.whl", b"\x7fELF cholmod_analyze")
    assert check_wheel.faults(wheel) == [f"{CORE.name} holds CHOLMOD, parts of which are GPL"]
    assert not check_wheel.faults(write_wheel(tmp_path / "a-manylinux.whl", b"\x7fELF"))


def test_libraries_of_a_systems_ceres_are_found_in_a_map_of_memory() -> None:
    line = "7f0000000000-7f0000001000 r-xp 00000000 fe:00 12                     {}\n"
    own = "/venv/dqslam/_core.so", "/usr/lib/libm.so.6", "/venv/numpy.libs/libopenblas.so"
    foreign = ["/usr/lib/libceres.so.3", "/usr/lib/libcholmod.so.3", "/usr/lib/libgomp.so.1.0.0"]
    maps = "".join(line.format(path) for path in [*foreign, *own, foreign[0], "[heap]"])
    assert solve_seeds.foreign_libraries(maps) == foreign
    assert solve_seeds.foreign_libraries(line.format("") + line.format("[stack]")) == []


@pytest.mark.parametrize(("difference", "fits"), [(1e-10, True), (3e-9, False), (np.nan, False)])
def test_results_of_two_builds_are_compared(tmp_path: Path, difference: float, fits: bool) -> None:
    a, b = tmp_path / "a.npz", tmp_path / "b.npz"
    poses, objects = np.zeros((4, 3)), np.zeros((2, 9))
    np.savez(a, poses=poses, objects=objects)
    objects[1, 2] += difference
    np.savez(b, poses=poses, objects=objects)
    if fits:
        assert "of 2 arrays: 1.0e-10, in objects" in solve_seeds.compare(a, b)
    else:
        with pytest.raises(SystemExit, match=r"(3\.0e-09|nan), in objects, above 1e-09"):
            solve_seeds.compare(a, b)


def test_results_of_other_seeds_are_not_compared(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", poses=np.zeros(3))
    np.savez(tmp_path / "b.npz", objects=np.zeros(3))
    with pytest.raises(SystemExit, match="different arrays"):
        solve_seeds.compare(tmp_path / "a.npz", tmp_path / "b.npz")


def test_one_drive_is_solved() -> None:
    arrays = solve_seeds.solve(0, monocular=False)
    assert set(arrays) == {"0_positions_poses", "0_positions_objects"}
    assert arrays["0_positions_objects"].shape[1] == 9
    assert all(np.isfinite(array).all() for array in arrays.values())


def test_sources_of_the_static_ceres_are_pinned() -> None:
    script = (ROOT / ".ci" / "static_ceres").read_text()
    sums = re.findall(r'^  "([0-9a-f]{64})  (\S+\.orig\.tar\.\w+)"$', script, flags=re.MULTILINE)
    assert [name.split("_")[0] for _, name in sums] == ["ceres-solver", "eigen3"]
