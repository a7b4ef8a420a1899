"""Check the includes of the C++ core: python .ci/check_layers.py [ROOT].

They go down the rooms of cpp/dqslam or stay in one, and never in a circle. Headers of Ceres are
included where they are needed. Public headers, the ones that CMakeLists.txt lists, do without
private ones and, the costs aside, without Ceres.
"""

import re
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOMS = ["geometry", "costs", "linear", "tracks", "problem", "solver", "estimation", "online"]
UMBRELLA = "dqslam/dqslam.h"  # includes all public headers that need no Ceres
CERES = re.compile(r"(ceres|glog)/")
USES_CERES = re.compile(
    r"dqslam/(costs/.*|geometry/(body|body_derivatives|manifolds|jets)|solver/.*)\.h|.*\.cc"
)
WITH_CERES = re.compile(r"dqslam/(costs/.*|geometry/(body|manifolds))\.h")  # public: dqslam::costs

Includes = dict[str, dict[str, int]]  # the lines of what each file includes


def read_includes(cpp: Path) -> Includes:
    """Read the sources of the core, named as they are included: dqslam/geometry/pose.h."""
    found: Includes = {}
    for path in sorted(path for path in cpp.glob("dqslam/**/*") if path.suffix in (".h", ".cc")):
        lines = path.read_text(encoding="utf-8").splitlines()
        matches = (re.match(r'#include [<"](.+)[">]', line) for line in lines)
        found[path.relative_to(cpp).as_posix()] = {
            match[1]: number for number, match in enumerate(matches, 1) if match
        }
    return found


def room(file: str) -> str:
    """Name the room of a file: the folder that it is in."""
    return file.split("/")[1]


def floor(file: str) -> int:
    """Say how high the room of a file is; the umbrella and what is unknown are above all rooms."""
    return ROOMS.index(room(file)) if room(file) in ROOMS else len(ROOMS)


def complaints(file: str, target: str, public: set[str]) -> Iterator[str]:
    """Say what is wrong with one file's including another."""
    users_of_ceres = WITH_CERES if file in public else USES_CERES
    if CERES.match(target) and not users_of_ceres.fullmatch(file):
        yield (
            "Ceres belongs into costs, body.h, manifolds.h, jets.h, private solver headers and .cc "
            "files"
        )
    if not target.startswith("dqslam/"):
        return
    if floor(target) > floor(file):
        yield f"{room(target)} is above {room(file)}: {' < '.join(ROOMS)}"
    if file in public and target not in public:
        yield "this header is public and installed, the included one is not"
    if file in public and WITH_CERES.fullmatch(target) and not WITH_CERES.fullmatch(file):
        yield "only dqslam::costs needs Ceres, and this header is part of dqslam::dqslam"


def circles(includes: Includes) -> Iterator[str]:
    """Name a circle of includes, where there is one."""
    try:
        TopologicalSorter(includes).prepare()
    except CycleError as error:
        circle = error.args[1][::-1]
        line = includes[circle[0]][circle[1]]
        yield f"cpp/{circle[0]}:{line}: a circle: {' -> '.join(circle)}"


def faults(root: Path) -> list[str]:
    """Say what is wrong with the core of a repository, a line a fault."""
    includes = read_includes(root / "cpp")
    listed = (root / "CMakeLists.txt").read_text(encoding="utf-8")
    public = set(re.findall(r"cpp/(dqslam/\S+\.h)\b", listed))
    homeless = [file for file in includes if floor(file) == len(ROOMS) and file != UMBRELLA]
    found = [f"cpp/{file}: is in none of the rooms {', '.join(ROOMS)}" for file in homeless]
    found += [
        f"cpp/{file}:{line}: includes {target}, but {complaint}"
        for file, targets in includes.items()
        for target, line in targets.items()
        for complaint in complaints(file, target, public)
    ]
    without_ceres = {file for file in public if not WITH_CERES.fullmatch(file)}
    missing = sorted(without_ceres - {UMBRELLA} - set(includes[UMBRELLA]))
    found += [f"cpp/{UMBRELLA}: does not include {file}, which is public" for file in missing]
    return [*found, *circles(includes)]


if __name__ == "__main__":
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1]
    if found := faults(root):
        sys.exit("\n".join(found))
