"""All figures of a directory of results."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dqslam.evaluation import common_poses, fit_boxes, object_alignment, pose_errors
from dqslam.io import Results, Trajectory, TrueObjects
from dqslam.metrics import Align
from dqslam.plot.boxes import draw_worst_and_median
from dqslam.plot.errors import draw_errors
from dqslam.plot.path_error import draw_path_error
from dqslam.plot.residuals import draw_residuals
from dqslam.plot.results_map import MapTruth, draw_results_map
from dqslam.plot.style import column_style, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Drawn:
    """The figures that were drawn, and those that were left out."""

    written: tuple[Path, ...]
    left_out: dict[str, str]
    """The reason why a figure was left out, by its name."""


def plot_results(
    results: Results,
    folder: str | Path,
    *,
    kind: str = "svg",
    groundtruth: Trajectory | None = None,
    objects: TrueObjects | None = None,
    align: Align = "se3",
    max_time_difference: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Drawn:
    """Draw all figures that the results allow, as files of a kind: "svg", "png" or "pdf".

    These are ``map``, ``boxes``, ``residuals``, and with a true trajectory ``path_error``,
    ``position_error`` and ``rotation_error``. docs/plots.md describes each. If one cannot be
    drawn, nothing is written.

    Parameters
    ----------
    groundtruth, objects
        The truth, in any world, as for ``evaluate_results``.
    align, max_time_difference
        As for ``evaluate_results``.
    progress
        Called with the share of the files that has been written.
    """
    figures: dict[str, Figure] = {}
    left_out: dict[str, str] = {}
    truth = None
    if groundtruth is None:
        reason = "there is no true trajectory"
        left_out = dict.fromkeys(("path_error", "position_error", "rotation_error"), reason)
    else:
        truth = _map_truth(results, groundtruth, objects, align, max_time_difference)
        errors = pose_errors(
            results, groundtruth, align=align, max_time_difference=max_time_difference
        )
        rows, _ = common_poses(results.timestamps, groundtruth, max_time_difference)
        figures["path_error"] = draw_path_error(truth, results.poses[rows, :3], errors.distance)
        figures["position_error"] = draw_errors(errors, "position")
        figures["rotation_error"] = draw_errors(errors, "rotation")
    figures["map"] = draw_results_map(results, truth)
    _draw_boxes(results, figures, left_out)
    folder = Path(folder)
    written = []
    with column_style():
        for name, figure in figures.items():
            written.append(folder / f"{name}.{kind}")
            save_figure(figure, written[-1])
            progress(len(written) / len(figures))
    return Drawn(tuple(sorted(written)), left_out)


def _draw_boxes(results: Results, figures: dict[str, "Figure"], left_out: dict[str, str]) -> None:
    if results.boxes is None:
        left_out |= dict.fromkeys(("boxes", "residuals"), "there is no boxes.csv")
        return
    fits = fit_boxes(results)
    if not (fits.object_row >= 0).any():
        left_out |= dict.fromkeys(("boxes", "residuals"), "no box shows an object of the map")
        return
    figures["boxes"] = draw_worst_and_median(results, fits)
    if fits.is_uncut.any():
        figures["residuals"] = draw_residuals(fits)
    else:
        left_out["residuals"] = "no box of a mapped object is free of the image border"


def _map_truth(
    results: Results,
    groundtruth: Trajectory,
    objects: TrueObjects | None,
    align: Align,
    max_time_difference: float | None,
) -> MapTruth:
    rows, true_rows = common_poses(results.timestamps, groundtruth, max_time_difference)
    true_poses = groundtruth.world_from_camera[true_rows]
    alignment, _ = object_alignment(results, results.poses[rows], true_poses, align)
    return MapTruth(groundtruth.timestamps[true_rows], true_poses, objects, alignment)
