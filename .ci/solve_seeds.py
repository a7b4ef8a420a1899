"""Solve the paper's scenario, to compare two builds of the core.

python .ci/solve_seeds.py [--alone] [OUTPUT.npz]    --alone: with no Ceres but the wheel's own
python .ci/solve_seeds.py --compare A.npz B.npz
"""

import argparse
import dataclasses
import re
import sys
from pathlib import Path

import numpy as np

import dqslam as dq

SEEDS = range(5)
TOLERANCE = 1e-9  # of every number: meters, radians, log-meters

# What a Ceres of a Linux distribution brings along; libgomp comes with its CHOLMOD.
FOREIGN = r"lib(ceres|glog|gflags|gomp|cholmod|spqr|suitesparse\w*|cxsparse|amd|colamd|metis)[-.]"


def foreign_libraries(maps: str) -> list[str]:
    """Give the file names in /proc/PID/maps that belong to a system's Ceres, sorted."""
    paths = {line.split(maxsplit=5)[5] for line in maps.splitlines() if line.count("/")}
    return sorted(path for path in paths if re.match(FOREIGN, Path(path).name))


def solve(seed: int, monocular: bool) -> dict[str, np.ndarray]:
    """Estimate one drive.

    The tolerance stays the default's. Two solvers take the same steps until only the cost's last
    digits change; from there on rounding says which step is accepted, and results part by 1e-7.
    """
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=seed)
    if monocular:
        recording = dataclasses.replace(recording, positions=None)
    estimate, summary = dq.solve(dq.build_graph(recording))
    print(f"seed {seed}, {'boxes' if monocular else 'boxes and positions'}: {summary}")
    name = f"{seed}_{'boxes' if monocular else 'positions'}"
    return {f"{name}_poses": estimate.poses, f"{name}_objects": estimate.ellipsoids}


def compare(a: Path, b: Path) -> str:
    """Give the largest difference in words; raises SystemExit if it is above the tolerance."""
    with np.load(a) as first, np.load(b) as second:
        if set(first) != set(second):
            raise SystemExit(f"{a} and {b} hold different arrays")
        largest = {name: np.abs(first[name] - second[name]).max() for name in first}
    worst = max(largest, key=lambda name: np.nan_to_num(largest[name], nan=np.inf))
    text = f"largest difference of {len(largest)} arrays: {largest[worst]:.1e}, in {worst}"
    if not largest[worst] <= TOLERANCE:
        raise SystemExit(f"{text}, above {TOLERANCE:.0e}")
    return text


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--compare", nargs=2, type=Path, metavar="FILE")
    parser.add_argument("output", nargs="?", type=Path)
    arguments = parser.parse_args()
    if arguments.compare:
        print(compare(*arguments.compare))
        return
    arrays = {}
    for seed in SEEDS:
        for monocular in (True, False):
            arrays |= solve(seed, monocular)
    if arguments.alone and (found := foreign_libraries(Path("/proc/self/maps").read_text())):
        raise SystemExit(f"the wheel uses the system's {', '.join(found)}")
    if arguments.output:
        np.savez(arguments.output, **arrays)


if __name__ == "__main__":
    sys.exit(main())
