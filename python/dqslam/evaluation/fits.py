"""The fit of each box to the map, for figures of residuals and of images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.assumptions import BoxNoise
from dqslam.evaluation.boxes import box_overlaps
from dqslam.io import BoxTable, FileError, Results
from dqslam.solids import project_to_boxes


@dataclass(frozen=True, eq=False)
class BoxFits:
    """The boxes of ``boxes.csv`` with the projections of their objects, row by row."""

    boxes: BoxTable
    object_row: Ints
    """Row of the object in the map, -1 for none; shape (m,)."""
    predicted: Floats
    """Box of the projection, undistorted pixels, shape (m, 4); NaN where there is none."""
    residual: Floats
    """(predicted - detected) / sigma of each edge, shape (m, 4); NaN where there is no projection,
    and for edges that are the border of the image."""
    overlap: Floats
    """IoU of box and projection, shape (m,); 0 if the object is not in front, NaN if not mapped."""
    noise: BoxNoise
    """The noise that sigma is computed from."""

    @property
    def is_uncut(self) -> Bools:
        """Whether all four edges can be compared, shape (m,)."""
        return np.asarray(np.isfinite(self.residual).all(axis=1))

    @property
    def chi2(self) -> Floats:
        """Sum of the squares of the residuals, shape (m,); NaN unless the box is uncut."""
        return np.asarray(np.sum(self.residual**2, axis=1))

    def frames(self, least_boxes: int = 1) -> tuple[Ints, Floats]:
        """Return the poses with boxes of mapped objects, by ascending mean overlap, and it; (f,).

        A pose needs at least ``least_boxes`` such boxes.
        """
        known = np.isfinite(self.overlap)
        pose, row = np.unique(self.boxes.pose[known], return_inverse=True)
        count = np.bincount(row)
        mean = np.bincount(row, weights=self.overlap[known]) / np.maximum(count, 1)
        pose, mean = pose[count >= least_boxes], mean[count >= least_boxes]
        order = np.argsort(mean, kind="stable")
        return pose[order], mean[order]


def fit_boxes(results: Results) -> BoxFits:
    """Compare each box with its object; sigmas come from the run's report, or else are the default.

    Raises
    ------
    ValueError
        If there is no ``boxes.csv``.
    """
    boxes, objects = results.boxes, results.objects
    if boxes is None:
        raise ValueError(f"{results.directory}: there is no boxes.csv")
    row_of = {int(number): row for row, number in enumerate(objects.object_ids)}
    row = np.array([row_of.get(int(number), -1) for number in boxes.object_id], dtype=np.int64)
    mapped = np.flatnonzero(row >= 0)
    predicted = np.full((len(boxes), 4), np.nan)
    predicted[mapped], _ = project_to_boxes(
        _core.PoseModel.SE3,
        results.camera,
        results.poses[boxes.pose[mapped]],
        objects.solids.take(row[mapped]),
    )
    noise = _noise(results)
    variance = np.diagonal(noise.covariance(boxes.box, results.camera), axis1=1, axis2=2)
    residual = np.where(boxes.truncated, np.nan, predicted - boxes.box) / np.sqrt(variance)
    return BoxFits(boxes, row, predicted, residual, box_overlaps(results, boxes), noise)


def _noise(results: Results) -> BoxNoise:
    given = results.report.get("box_noise")
    if given is None:
        return BoxNoise()
    try:
        noise = BoxNoise(float(given["pixels"]), float(given["relative"]))
        noise.covariance(np.zeros((0, 4)))
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(results.directory / "report.json", f"box_noise: {error}") from None
    return noise
