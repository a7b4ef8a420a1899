"""What was measured, as plain data, and its file."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from statistics import median

from pydantic import TypeAdapter, ValidationError

Size = dict[str, int]


@dataclass(frozen=True)
class Stage:
    """How long one stage of a run took."""

    wall_s: float
    cpu_s: float
    """Of all threads."""


@dataclass(frozen=True)
class Score:
    """How good an answer is: the same for every program."""

    rmse_m: float
    """Root mean square distance of the positions from the true ones, on the plane."""
    aligned_rmse_m: float
    """The same without the global rigid motion."""
    center_rmse_m: float
    """Likewise of the objects' centers, in space, no alignment."""
    box_rms_px: float
    """Root mean square difference between edges of predicted and measured boxes."""
    impossible_boxes: int
    """Boxes whose object is no ellipsoid in front of the camera; not in box_rms_px."""


@dataclass(frozen=True)
class Run:
    """One run of a program on a problem, in a process of its own."""

    stages: dict[str, Stage] = field(default_factory=dict)
    """build: from arrays to the solver's graph; start: first values; solve: all the rest."""
    peak_mb: float = 0.0
    iterations: int = 0
    cost: float = 0.0
    """What this program minimized, at the end: half the sum of squares in sigmas."""
    start_seconds: float | None = None
    """Wall clock inside of solve, where the program tells: starting objects."""
    evaluation_seconds: float | None = None
    """Likewise: residuals and Jacobians."""
    linear_solver_seconds: float | None = None
    """Likewise: normal equations, their factors and steps."""
    step_ms: dict[str, float] = field(default_factory=dict)
    """Wall clock of a step where the program goes step by step: p50, p99, worst, total."""
    score: Score | None = None
    failure: str = ""
    """Why there is no answer."""


@dataclass(frozen=True)
class Measured:
    """All runs of a program on a case."""

    case: str
    program: str
    size: Size
    """`poses`, `objects`, `boxes`."""
    runs: tuple[Run, ...]

    @property
    def failure(self) -> str:
        """Why there are no figures; empty when every run gave an answer."""
        return next((run.failure for run in self.runs if run.failure), "")

    def cpu_s(self, stage: str = "total") -> tuple[float, float, float]:
        """Return the median, least and greatest CPU time of a stage, or of all, seconds."""
        return spread([_seconds(run, stage, "cpu_s") for run in self.runs])

    def wall_s(self, stage: str = "total") -> tuple[float, float, float]:
        """Return the same of the wall clock."""
        return spread([_seconds(run, stage, "wall_s") for run in self.runs])

    @property
    def peak_mb(self) -> float:
        """Median over the runs."""
        return median(run.peak_mb for run in self.runs)


@dataclass(frozen=True)
class Linearized:
    """Time to linearize one measurement, from Google Benchmark."""

    name: str
    cpu_ns: tuple[float, ...]
    """One for each repetition."""


@dataclass(frozen=True)
class Results:
    """Everything that one call measured."""

    machine: dict[str, str]
    version: str
    seed: int
    measured: tuple[Measured, ...]
    linearized: tuple[Linearized, ...] = ()
    skipped: dict[str, str] = field(default_factory=dict)
    """Programs that could not run here, and why."""

    def find(self, case: str, program: str) -> Measured | None:
        """Return the figures of a program on a case, if it gave an answer."""
        for one in self.measured:
            if (one.case, one.program) == (case, program) and not one.failure:
                return one
        return None


def spread(values: list[float]) -> tuple[float, float, float]:
    """Return median, least and greatest."""
    return median(values), min(values), max(values)


def _seconds(run: Run, stage: str, clock: str) -> float:
    stages = run.stages.values() if stage == "total" else [run.stages[stage]]
    return sum(float(getattr(one, clock)) for one in stages)


_FILE = TypeAdapter(Results)


def save_results(results: Results, path: Path) -> None:
    """Write JSON."""
    path.write_text(json.dumps(asdict(results), indent=1) + "\n", encoding="utf-8")


def load_results(path: Path) -> Results:
    """Read what `save_results` wrote; a ValueError names the file and what is wrong."""
    try:
        return _FILE.validate_python(json.loads(path.read_text(encoding="utf-8")))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}:{error.lineno}: not JSON: {error.msg}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{path}: {place}: {first['msg']}") from None
