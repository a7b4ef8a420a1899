"""The usual mistakes. Each is found by comparing two interpretations of the same files.

Each check takes the Evidence. It returns a Finding, or None if all is well, or raises
NotEnoughDataError. A finding needs another interpretation that explains the boxes far better. The
thresholds were chosen on recordings of four kinds, without mistakes and with each mistake planted.
"""

from __future__ import annotations

import itertools

import numpy as np

from dqslam import _core
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError, median_residual
from dqslam.inspection.pose_checks import pixels
from dqslam.inspection.rays import Views, residuals
from dqslam.io import FileError
from dqslam.io.detections.table import checked
from dqslam.lens import ideal_pixels

# Boxes below the default of `dqslam run --min-score` do not refuse a file.
LEAST_SCORE = 0.5
# The share of the median residual that another lens may leave, and the least number of tracks. For
# right cameras, the best of the wrong lenses left 0.90; for a wrong camera it left 0.77.
LENS_SHARE, LENS_TRACKS = 0.85, 5
# No lens is a single alternative, not the best of many: it left 1.09 of the median residual for a
# right lens, 0.86 for a wrong one.
BARE_SHARE = 0.92
# If rays miss each other by more than this, there is another reason [px].
LARGEST_LENS_PX = 50.0
RADIAL = tuple(
    itertools.product(
        (-0.4, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        (-0.8, -0.4, -0.2, 0.0, 0.1, 0.2),
    )
)


def check_distortion(evidence: Evidence) -> Finding | None:
    """Compare the lens as given with none, and with a grid of others, by how well rays meet.

    The best of the grid has the smallest robust sum over the tracks. It is then compared by its
    median residual.
    """
    camera = evidence.camera
    views = evidence.views(evidence.tracks())
    if len(views.there) < LENS_TRACKS:
        raise NotEnoughDataError(f"only {len(views.there)} objects to compare lenses with")
    given = median_residual(camera, views)
    if given > LARGEST_LENS_PX:
        raise NotEnoughDataError(
            f"rays miss each other by {pixels(given)}, too much to compare lenses"
        )
    if camera.has_distortion:
        bare = median_residual(_with_lens(camera, 0.0, 0.0), views) / given
        if bare <= BARE_SHARE:
            return Finding(
                "distortion",
                f"without the lens's distortion rays to an object miss each other by {bare:.0%} of "
                "what they do with it: are the boxes undistorted already?",
            )
    share, (k1, k2) = _best_lens(camera, views, given)
    if share > LENS_SHARE:
        return None
    meaning = (
        "is it the lens of another camera?"
        if camera.has_distortion
        else "do the boxes come from a distorted image, without distortion in the camera file?"
    )
    return Finding(
        "distortion",
        f"with k1 = {k1:g}, k2 = {k2:g} rays to an object miss each other by {share:.0%} of what "
        f"they do with the given lens: {meaning}",
    )


def _best_lens(
    camera: _core.Camera, views: Views, unit: float
) -> tuple[float, tuple[float, float]]:
    """Return the share of the median residual that the best lens leaves, and its k1 and k2."""
    base = residuals(camera, views)
    best_cost, best_share, best = 0.0, 1.0, (0.0, 0.0)
    for k1, k2 in RADIAL:
        lens = _with_lens(camera, k1, k2)
        if np.isnan(ideal_pixels(lens, views.middle)).any():
            continue  # the lens has no inverse at one of the boxes
        other = residuals(lens, views)
        both = ~(np.isnan(base) | np.isnan(other))
        if np.sum(both.any(axis=1)) < LENS_TRACKS:
            continue
        old, new = base[both], other[both]
        cost = float(np.mean(np.log1p((new / unit) ** 2) - np.log1p((old / unit) ** 2)))
        if cost < best_cost:
            best_cost, best = cost, (k1, k2)
            best_share = float(np.median(new) / np.median(old))
    return best_share, best


def check_boxes(evidence: Evidence) -> Finding | None:
    """Check whether the reader accepts all boxes, scores and times, as in `dqslam run`."""
    camera = evidence.camera
    try:
        checked(
            evidence.table,
            width=camera.width,
            height=camera.height,
            cut=True,
            min_score=LEAST_SCORE,
        )
    except FileError as error:
        return Finding("boxes", f"the file will be refused: {error}")
    return None


def _with_lens(camera: _core.Camera, k1: float, k2: float) -> _core.Camera:
    return _core.Camera(
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        camera.width,
        camera.height,
        distortion=[k1, k2, 0.0, 0.0, 0.0],
    )
