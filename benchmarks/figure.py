"""Time and memory against the number of boxes."""

from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.results import Measured, Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# In shades that the color-blind can tell apart (Okabe and Ito).
_COLORS = {"dqslam": "#D55E00", "gtsam_quadrics": "#0072B2", "scipy": "#009E73"}


def scaling_cases(results: Results) -> dict[str, list[Measured]]:
    """Return by program the chains of areas it solved, fewest boxes first; two sizes or none."""
    found: dict[str, list[Measured]] = {}
    for one in sorted(results.measured, key=lambda one: one.size["boxes"]):
        # The paper's drive is of another kind; step by step is another way to solve peer-9 again.
        if one.case not in ("paper", "online-5k") and not one.failure:
            found.setdefault(one.program, []).append(one)
    return found if any(len(sizes) > 1 for sizes in found.values()) else {}


def plot_scaling(results: Results, path: Path) -> None:
    """Draw both on logarithmic axes, with a line of slope one.

    Raises
    ------
    ValueError
        When there are no two sizes.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    cases = scaling_cases(results)
    if not cases:
        raise ValueError("there are no chains of areas of two sizes to draw")
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    time, memory = figure.subplots(1, 2)
    for program, measured in cases.items():
        boxes = [one.size["boxes"] for one in measured]
        style = {"color": _COLORS.get(program), "marker": "o", "label": program}
        middle, least, greatest = zip(*(one.cpu_s() for one in measured), strict=True)
        time.plot(boxes, middle, **style)
        time.fill_between(boxes, least, greatest, color=_COLORS.get(program), alpha=0.2)
        memory.plot(boxes, [one.peak_mb for one in measured], **style)
    reference = next(iter(cases.values()))
    _draw_linear(time, reference)
    time.set_ylabel("CPU time, build to solution [s]")
    memory.set_ylabel("peak memory of the process [MB]")
    for axes in (time, memory):
        axes.set(xscale="log", yscale="log", xlabel="boxes")
        axes.grid(alpha=0.25, linewidth=0.5)
    time.legend(frameon=False)
    figure.savefig(path, dpi=150)


def _draw_linear(axes: "Axes", measured: list[Measured]) -> None:
    """Continue the smallest case in proportion to the boxes."""
    boxes = [one.size["boxes"] for one in measured]
    seconds = measured[0].cpu_s()[0]
    line = [seconds * count / boxes[0] for count in boxes]
    axes.plot(boxes, line, color="0.6", linestyle=":", label="proportional to boxes")
