"""The C++ benchmark of residuals and Jacobians, where it was built."""

import json
import subprocess
from pathlib import Path

from benchmarks.measure import ROOT
from benchmarks.results import Linearized

PROGRAM = ROOT / "build" / "run" / "dqslam_linearize"
_NANOSECONDS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}


def linearize(repeat: int, program: Path = PROGRAM) -> tuple[Linearized, ...]:
    """Run it; FileNotFoundError where it was not built."""
    process = subprocess.run(
        [program, "--benchmark_format=json", f"--benchmark_repetitions={repeat}"],
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    return read_google_benchmark(process.stdout)


def read_google_benchmark(text: str) -> tuple[Linearized, ...]:
    """Read its JSON; repetitions come one by one, then aggregates, which are left out."""
    times: dict[str, list[float]] = {}
    for one in json.loads(text)["benchmarks"]:
        if one["run_type"] == "iteration":
            nanoseconds = one["cpu_time"] * _NANOSECONDS[one["time_unit"]]
            times.setdefault(one["run_name"], []).append(nanoseconds)
    return tuple(Linearized(name, tuple(values)) for name, values in times.items())
