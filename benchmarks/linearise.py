"""The C++ benchmark of residuals and Jacobians, where it was built."""

import json
import subprocess
from pathlib import Path

from benchmarks.measure import ROOT
from benchmarks.results import Linearised

PROGRAM = ROOT / "build" / "run" / "dqslam_linearise"
_NANOSECONDS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}


def linearise(repeat: int, program: Path = PROGRAM) -> tuple[Linearised, ...]:
    """Run it; FileNotFoundError where it was not built."""
    process = subprocess.run(
        [program, "--benchmark_format=json", f"--benchmark_repetitions={repeat}"],
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    return read_google_benchmark(process.stdout)


def read_google_benchmark(text: str) -> tuple[Linearised, ...]:
    """Read its JSON; repetitions come one by one, then aggregates, which are left out."""
    times: dict[str, list[float]] = {}
    for one in json.loads(text)["benchmarks"]:
        if one["run_type"] == "iteration":
            nanoseconds = one["cpu_time"] * _NANOSECONDS[one["time_unit"]]
            times.setdefault(one["run_name"], []).append(nanoseconds)
    return tuple(Linearised(name, tuple(values)) for name, values in times.items())
