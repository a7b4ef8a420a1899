"""The style of all figures: sizes, files, and colors that color-blind readers can distinguish."""

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dqslam._colors import BLUE as BLUE
from dqslam._colors import ESTIMATE as ESTIMATE
from dqslam._colors import GRAY as GRAY
from dqslam._colors import GREEN as GREEN
from dqslam._colors import ODOMETRY as ODOMETRY
from dqslam._colors import ORANGE as ORANGE
from dqslam._colors import PURPLE as PURPLE
from dqslam._colors import SKY as SKY
from dqslam._colors import TRUTH as TRUTH
from dqslam._colors import VERMILLION as VERMILLION
from dqslam._colors import YELLOW as YELLOW
from dqslam._files import FileError, whole_file
from dqslam._repr import printable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN_INCHES = 3.3
FORMATS = ("svg", "png", "pdf")
_DPI = 300
_RC = {
    "font.size": 7.0,
    "axes.titlesize": 7.5,
    "axes.labelsize": 7.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.0,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.0,
    "pdf.fonttype": 42,  # keeps text as text
    "text.parse_math": False,  # names of classes are no formulas
    "svg.hashsalt": "dqslam",  # makes files reproducible
}
_NO_DATE = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": None}


@contextlib.contextmanager
def column_style() -> Iterator[None]:
    """Use the sizes for a column of text, for drawing and for saving figures."""
    from matplotlib import rc_context

    with rc_context(_RC), warnings.catch_warnings():  # type: ignore[arg-type]
        # A name in letters that the font lacks is drawn as boxes; all else is as it should be.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of a size in inches, without a window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def shown_name(name: str) -> str:
    """Return the name of a class as a label: Matplotlib leaves out those that begin with "_"."""
    shown = printable(name)
    return f" {shown}" if shown.startswith("_") else shown


def say_frame(axes: "Axes", text: str) -> None:
    """Say above a figure in which frame it is."""
    axes.set_title(text, loc="left", pad=2.0, fontsize=6.5, color="0.3")


def legend_above(figure: "Figure", handles: "Sequence[Artist]") -> None:
    """Put a legend of one line above all axes."""
    figure.legend(
        handles=handles,
        loc="outside upper center",
        ncols=len(handles),
        frameon=False,
        borderpad=0.1,
    )


def save_figure(figure: "Figure", path: str | Path, *, dpi: float = _DPI) -> None:
    """Write a figure in the format of its suffix; the file is complete or absent."""
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in FORMATS:
        raise FileError(path, f"its name ends in none of {', '.join('.' + one for one in FORMATS)}")
    with whole_file(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=dpi, metadata=_NO_DATE[kind])
