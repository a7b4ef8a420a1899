"""The usual mistakes. Each is found by comparing two interpretations of the same files.

Each check takes the Evidence. It returns a Finding, or None if all is well, or raises
NotEnoughDataError. A finding needs another interpretation that explains the boxes far better. The
thresholds were chosen on recordings of four kinds, without mistakes and with each mistake planted.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError, median_residual
from dqslam.inspection.rays import BEHIND_PX, Views, inverted, residuals
from dqslam.io import FileError
from dqslam.io.detections.table import checked

# Boxes below the default of `dqslam run --min-score` do not refuse a file.
LEAST_SCORE = 0.5
Floats = NDArray[np.float64]

# The share of the median residual that the other interpretation must fall below. Corners: for right
# files the other one leaves 10 times as much. Poses: with a drift of 15 px per step, it leaves only
# once to twice as much.
CORNERS_SHARE, DIRECTION_SHARE = 0.5, 0.7
# The share of impossible boxes that makes a mistake, and the part of it that may remain.
IMPOSSIBLE_SHARE, LEFT_SHARE = 0.05, 0.03
# The distance by which trackers predict boxes beyond the image [share of the image].
BEYOND = 0.02
# The largest distance of a principal point from the middle of the image [share of the image].
OFF_MIDDLE = 0.15
# Boxes that end together but begin at different places: the least number of beginnings, the least
# share of all boxes, and the end below which they are not at the border [share of the image].
FEWEST_PILED, PILED_SHARE, WITHIN = 5, 0.01, 0.9
ALIKE_PX = 5.0
# The share of the median residual that another lens may leave, and the least number of tracks. For
# right cameras, the best of the wrong lenses left 0.90; for a wrong camera it left 0.77.
LENS_SHARE, LENS_TRACKS = 0.85, 5
# No lens is a single alternative, not the best of many: it left 1.09 of the median residual for a
# right lens, 0.86 for a wrong one.
BARE_SHARE = 0.92
# If rays miss each other by more than this, there is another reason [px].
LARGEST_LENS_PX = 20.0
RADIAL = tuple(
    itertools.product(
        (-0.4, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        (-0.8, -0.4, -0.2, 0.0, 0.1, 0.2),
    )
)


def check_pose_direction(evidence: Evidence) -> Finding | None:
    """Compare the poses as given with their inverses, by how well rays meet."""
    views = evidence.views(evidence.tracks())
    given = median_residual(evidence.camera, views)
    turned = replace(views, world_from_camera=inverted(views.world_from_camera))
    other = median_residual(evidence.camera, turned)
    if given == other == BEHIND_PX:
        raise NotEnoughDataError("no reading of the poses puts the objects in front of the camera")
    if other > DIRECTION_SHARE * given:
        if other < given / DIRECTION_SHARE:
            raise NotEnoughDataError(
                f"rays miss each other by {_px(given)}, with inverted poses by {_px(other)}"
            )
        return None
    return Finding(
        "pose direction",
        f"the poses look like camera_from_world, not world_from_camera: rays to an object miss "
        f"each other by {_px(given)}, with inverted poses by {_px(other)}",
    )


def check_box_corners(evidence: Evidence) -> Finding | None:
    """Check whether corners are x, y, width and height instead, or the reverse.

    The first test counts impossible boxes, which are inverted or far outside of the image. If no
    interpretation makes any impossible, the second test compares how well rays meet.
    """
    box = evidence.table.box
    position, size = box[:, :2], box[:, 2:]
    readings = {
        "x1 y1 x2 y2 look like x, y, width, height": np.hstack([position, position + size]),
        "x, y, width, height look like x1 y1 x2 y2": np.hstack([position, size - position]),
    }
    given = _impossible(evidence.camera, box)
    for message, other in readings.items():
        left = _impossible(evidence.camera, other)
        if given >= IMPOSSIBLE_SHARE and left <= LEFT_SHARE:
            return Finding(
                "box corners",
                f"{message}: {given:.0%} of the boxes are inverted or leave the image, "
                f"read so {left:.0%}",
            )
        if given < IMPOSSIBLE_SHARE and left == 0 and _rays_prefer(evidence, other):
            if _border_within(evidence):
                return None  # an image of another size moves all rays
            return Finding("box corners", f"{message}: rays to an object meet far better then")
    return None


def check_image_size(evidence: Evidence) -> Finding | None:
    """Compare the image with the places where boxes end, and its middle with the principal point.

    Boxes of a larger image leave this one. Boxes of a smaller image pile up at its border, within
    this one. The principal point for another size is far from the middle.
    """
    camera, box = evidence.camera, evidence.table.box
    size = np.array([camera.width, camera.height])
    off = np.abs((np.array([camera.cx, camera.cy]) + 0.5) / size - 0.5)
    reach = np.quantile(box[:, 2:], 0.99, axis=0) + 0.5
    beyond = float(np.mean(np.any(box[:, 2:] > size * (1 + BEYOND), axis=1)))
    image = f"the image of {camera.width} x {camera.height} px"
    if beyond >= IMPOSSIBLE_SHARE and _impossible_shape(box) < IMPOSSIBLE_SHARE:
        return Finding(
            "image size",
            f"{beyond:.0%} of the boxes leave {image}: they go to {reach[0]:.0f}, {reach[1]:.0f}",
        )
    if off.max() > OFF_MIDDLE:
        return Finding(
            "image size",
            f"the principal point {camera.cx:g}, {camera.cy:g} is far from the middle of {image}: "
            "is it that of another size?",
        )
    border = _border_within(evidence)
    return None if border is None else Finding("image size", f"{border}, but {image} does not")


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
            f"rays miss each other by {_px(given)}, too much to compare lenses"
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
        try:
            other = residuals(_with_lens(camera, k1, k2), views)
        except ValueError:
            continue  # the lens has no inverse at one of the boxes
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


def _border_within(evidence: Evidence) -> str | None:
    """Return where boxes pile up well within the image, or None if they do not."""
    camera, box = evidence.camera, evidence.table.box
    for axis, size in enumerate((camera.width, camera.height)):
        end = float(box[:, 2 + axis].max())
        at_end = box[box[:, 2 + axis] > end - 1]
        # Boxes of an object that stands still end together as well, but boxes at a border begin at
        # different places.
        starts = len(np.unique(np.round(at_end[:, axis] / ALIKE_PX)))
        piled = starts >= FEWEST_PILED and len(at_end) >= PILED_SHARE * len(box)
        if piled and end < WITHIN * size:
            return f"{len(at_end)} boxes end at {'xy'[axis]} = {end:g}, as at a border"
    return None


def _impossible_shape(box: Floats) -> float:
    return float(np.mean(np.any(box[:, 2:] <= box[:, :2], axis=1)))


def _impossible(camera: _core.Camera, box: Floats) -> float:
    """Return the share of boxes that are inverted, or reach far out of the image."""
    size = np.array([camera.width, camera.height])
    bad = (box[:, 2:] <= box[:, :2]) | (box[:, 2:] > size * (1 + BEYOND))
    bad |= box[:, :2] < -BEYOND * size
    return float(np.mean(bad.any(axis=1)))


def _rays_prefer(evidence: Evidence, boxes: Floats) -> bool:
    try:
        tracks = evidence.tracks(boxes)
        given = median_residual(evidence.camera, evidence.views(tracks))
        other = median_residual(evidence.camera, evidence.views(tracks, boxes))
    except NotEnoughDataError:
        return False
    return other <= CORNERS_SHARE * given


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


def _px(value: float) -> str:
    return "more than the image" if value >= BEHIND_PX else f"{value:.1f} px"
