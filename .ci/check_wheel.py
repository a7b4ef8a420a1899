"""Check a repaired wheel: python .ci/check_wheel.py FILE.whl."""

import io
import sys
import zipfile
from pathlib import Path, PurePosixPath

from elftools.elf.elffile import ELFFile  # comes with auditwheel

MAX_BYTES = 3_000_000
LICENSES = {"LICENSE", "ceres-solver.txt", "eigen.txt", "pybind11.txt", "sources.txt"}
# Of every Linux with a glibc; all else is in the extension.
SYSTEM = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libgcc_s.so.1", "libstdc++.so.6"}
SYSTEM |= {"ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}


def needed_libraries(elf: bytes) -> set[str]:
    """Name the shared libraries that an ELF file is linked with."""
    dynamic = ELFFile(io.BytesIO(elf)).get_section_by_name(".dynamic")
    return {tag.needed for tag in dynamic.iter_tags("DT_NEEDED")}


def faults(wheel: Path) -> list[str]:
    """Say what is wrong with a wheel, in words."""
    found = []
    if wheel.stat().st_size >= MAX_BYTES:
        found.append(f"it has {wheel.stat().st_size} bytes, {MAX_BYTES} are allowed")
    if "manylinux" not in wheel.name:
        found.append("its name promises no manylinux platform")
    with zipfile.ZipFile(wheel) as archive:
        paths = [PurePosixPath(name) for name in archive.namelist()]
        files = {path: archive.read(str(path)) for path in paths if ".so" in path.name}
    licenses = {path.name for path in paths if path.parent.name == "licenses"}
    found += [f"the license {name} is missing" for name in sorted(LICENSES - licenses)]
    if [path.name.split(".")[0] for path in files] != ["_core"]:
        found.append(f"its binaries are {', '.join(map(str, files)) or 'none'}, not _core alone")
    for path, content in files.items():
        if foreign := needed_libraries(content) - SYSTEM:
            found.append(f"{path.name} needs {', '.join(sorted(foreign))}")
        if b"cholmod_" in content:
            found.append(f"{path.name} holds CHOLMOD, parts of which are GPL")
    return found


def main(wheel: Path) -> None:
    """Print the wheel's size, or raise SystemExit with its faults."""
    if found := faults(wheel):
        raise SystemExit("\n".join(f"{wheel.name}: {fault}" for fault in found))
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.2f} MB, self-contained")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
